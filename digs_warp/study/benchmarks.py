"""The benchmarks of ``digs-warp bench NAME``; imports none of them, because the command line reads this."""

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from digs_warp.checks import DigsError
from digs_warp.words import did_you_mean

if TYPE_CHECKING:
    from digs_warp.study.charts import Chart
    from digs_warp.study.results import Result


@dataclass(frozen=True)
class Benchmark:
    """A named measurement; functions are given as "module:function" below `digs_warp.study`.

    Attributes:
        name: as the command line takes it.
        summary: one line for the help.
        function: returns a list of `Result`; takes names out of ``cases``, if there are any, or nothing.
        page: file in docs/ that shows its tables (`scripts/pages.py`).
        chart_function: takes the results and returns charts; empty: there are none.
        cases: names of the cases, where one can measure some of them.
        join_function: takes results that were measured in parts and returns those of all cases together;
            empty: they stand one after the other.
    """

    name: str
    summary: str
    function: str
    page: str
    chart_function: str = ""
    cases: tuple[str, ...] = ()
    join_function: str = ""

    def run(self, only: Sequence[str] = ()) -> "list[Result]":
        """Import the module and measure all cases, or ``only`` some of `cases`."""
        return _load(self.function)(*([only] if only else []))

    def joined(self, results: "Sequence[Result]") -> "Sequence[Result]":
        """Return the results of parts as if all cases had been measured at once."""
        return _load(self.join_function)(results) if self.join_function else results

    def charts(self, results: "Sequence[Result]") -> "Sequence[Chart]":
        """Return what the results look like."""
        return _load(self.chart_function)(results) if self.chart_function else []


def _load(name: str) -> Any:
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(f"digs_warp.study.{module}"), function)


def find_benchmark(name: str) -> Benchmark:
    """Return the benchmark of that name.

    Raises:
        DigsError: there is none.
    """
    for benchmark in BENCHMARKS:
        if benchmark.name == name:
            return benchmark
    known = [benchmark.name for benchmark in BENCHMARKS]
    raise DigsError(f"bench '{name}': no such benchmark{did_you_mean(name, known)}")


BENCHMARKS = (
    Benchmark(
        "raster",
        "the splat rasterizer: its stages on 1, 2 and all threads, and their share of what a core can do",
        "bench_raster:bench_raster",
        "performance.md",
    ),
    Benchmark(
        "scaling",
        "how the time of a view grows with pixels, splats, overlap and threads; memory; compilation",
        "bench_scaling:bench_scaling",
        "performance.md",
        chart_function="bench_scaling:scaling_charts",
    ),
    Benchmark(
        "render",
        "frame rate of a film of the built-in object at three image sizes, with 1 thread and with all",
        "bench_trained:bench_render",
        "render.md",
    ),
    Benchmark(
        "view",
        "the page of `digs-warp view`: time of a frame; what --view adds to a training",
        "bench_view:bench_view",
        "view.md",
    ),
    Benchmark(
        "train",
        "a training step, stage by stage, at three image sizes",
        "bench_train:bench_train",
        "training.md",
    ),
    Benchmark(
        "convergence",
        "quality of held-out views over training time: settings for a dense start against those of 3DGS",
        "bench_quality:bench_convergence",
        "training.md",
        chart_function="bench_quality:convergence_charts",
    ),
    Benchmark(
        "paper-length",
        "training runs of 100, 1000 and 12,000 steps at 1600x900: seconds and quality",
        "bench_quality:bench_paper_length",
        "studies.md",
    ),
    Benchmark(
        "options",
        "the time that each training option costs and the quality that it gains",
        "bench_quality:bench_options",
        "training.md",
    ),
    Benchmark(
        "surface",
        "the trained surface against the true one, beside fused depth: six objects, two sensors",
        "bench_surface:bench_surface",
        "training.md",
        cases=(
            *("ycb_mustard_bottle", "avocado", "spot"),
            *("ycb_cracker_box", "armchair", "flight_helmet"),
        ),
        join_function="bench_surface:with_medians",
    ),
    Benchmark(
        "blur",
        "what drawing motion blur gains and costs: three objects, exposures of four lengths",
        "bench_blur:bench_blur",
        "training.md",
    ),
    Benchmark(
        "sfm",
        "structure from motion: seconds, memory and pose errors by pairing, features and mapper",
        "bench_sfm:bench_sfm",
        "sfm.md",
    ),
    Benchmark(
        "sfm-full",
        "structure from motion on 200 images of 1600x900",
        "bench_sfm:bench_sfm_full",
        "sfm.md",
    ),
    Benchmark(
        "sfm-sensor",
        "which imperfections of the camera make structure from motion less accurate",
        "bench_sfm:bench_sfm_sensor",
        "sfm.md",
    ),
    Benchmark(
        "sfm-poses",
        "what poses that nobody knows cost, found in each way, and poses that are nearly right",
        "bench_found_poses:bench_found_poses",
        "sfm.md",
        cases=(
            *("armchair", "ycb_mustard_bottle", "boot_plain", "sci_fi_case", "flight_helmet"),
            *("perturbed-ycb_mustard_bottle", "perturbed-spot", "perturbed-tea_set"),
            *("perturbed-avocado", "perturbed-boot_plain"),
        ),
    ),
    Benchmark(
        "masks",
        "object masks without a network, compared with the true ones",
        "bench_masks:bench_masks",
        "masks.md",
    ),
    Benchmark(
        "init",
        "200 depth maps of 2208x1242 to points: seconds, memory, distance to the true surface",
        "bench_init:bench_init",
        "initialization.md",
    ),
    Benchmark(
        "size",
        "objects of 6 cm to 2 m: Gaussians, seconds and quality by size and voxel",
        "bench_size:bench_size",
        "initialization.md",
    ),
    Benchmark(
        "no-depth",
        "photographs without depth: what each start gives, beside a start from depth",
        "bench_no_depth:bench_no_depth",
        "initialization.md",
    ),
    Benchmark(
        "init-noise",
        "all initializations under rising sensor noise and calibration errors, against true surfaces",
        "bench_init_noise:bench_init_noise",
        "initialization.md",
    ),
    Benchmark(
        "usd",
        "USD scenes of a million splats: write, read, validate; what each precision saves and loses",
        "bench_usd:bench_usd",
        "usd.md",
    ),
    Benchmark(
        "mesh",
        "the mesh of the built-in object at four voxel sizes: seconds, triangles, distance to the truth",
        "bench_trained:bench_mesh",
        "mesh.md",
    ),
    Benchmark(
        "splat-files",
        "PLY, SPZ, .splat, USD: bytes, seconds to write and read, visible loss",
        "bench_trained:bench_splat_files",
        "interchange.md",
    ),
    Benchmark(
        "sim",
        "the simulated depth sensor: time and scores of every tier and effect, against real matching",
        "bench_sim:bench_sim",
        "sensor-cost.md",
        chart_function="bench_sim:sim_charts",
    ),
    Benchmark(
        "realism",
        "where the simulated sensor errs, against real matching: places, sizes, frames, confidence, time",
        "bench_realism:bench_realism",
        "sensor-cost.md",
        chart_function="realism_confidence:confidence_charts",
    ),
    Benchmark(
        "infrared",
        "the dots of the simulated D435 beside a real one's, and the depth that they give plain walls",
        "bench_infrared:bench_infrared",
        "sensor.md",
    ),
    Benchmark(
        "sensor-fit",
        "the fit of depth cameras: known figures found again, and what fitted ones predict on real pairs",
        "bench_sensor_fit:bench_sensor_fit",
        "sensor-fit.md",
    ),
    Benchmark(
        "recordings",
        "real recordings, poses as recorded and estimated: held-out quality, depth error, what goes wrong",
        "bench_recordings:bench_recordings",
        "real-recordings.md",
        cases=(
            *("hololens_room_sequence", "tum_cabinet_orbit", "lund_door_photos"),
            *("euroc_static_stereo", "zed2i_stereo_pair"),
        ),
    ),
)
