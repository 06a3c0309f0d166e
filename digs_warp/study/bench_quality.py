"""`digs-warp bench options|convergence|paper-length`: quality of held-out views by settings of the training.

An object is recorded with the depth law of a stereo camera (not timed) and initialized from its depth with
the true poses. Each benchmark is a list of runs from that start: one per option, one per set of learning
rates, one per length.
"""

import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.point_cloud import PointCloud
from digs_warp.device.parallel import default_threads
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from digs_warp.init.seed_gaussians import seed_gaussians
from digs_warp.init.strategies import STRATEGIES
from digs_warp.record.progress import progress
from digs_warp.study.charts import Chart, Curve
from digs_warp.study.results import Result
from digs_warp.study.scenes import OBJECT_SIZE, sample_data
from digs_warp.train.config import REFERENCE_RATES, Density, Rates, Stop, TrainConfig
from digs_warp.train.evaluate import TestView, load_test_views, render_views, score_views
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views


@dataclass(frozen=True)
class SceneSize:
    """Size of a recording and of its start: image [px], frames, edge of the voxels [m]."""

    width: int
    height: int
    frames: int
    voxel_size: float

    @property
    def image(self) -> str:
        """The image size as tables show it."""
        return f"{self.width}x{self.height}"


OPTIONS_SIZE = SceneSize(640, 360, frames=32, voxel_size=0.005)
OPTIONS_ITERATIONS, MAX_SPLATS = 400, 40_000
# As the command line spells them, and what they set.
OPTIONS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("defaults", {}),
    ("--sh-degree 3", {"sh_degree": 3}),
    ("--background white", {"background": "white"}),
    ("--depth-weight 0.02", {"depth_weight": 0.02}),
    ("--dssim-weight 0", {"dssim_weight": 0.0}),
    ("--density adaptive", {"density": Density(strategy="adaptive", max_splats=MAX_SPLATS)}),
    ("--density absgrad", {"density": Density(strategy="absgrad", max_splats=MAX_SPLATS)}),
    ("--density mcmc", {"density": Density(strategy="mcmc", max_splats=MAX_SPLATS)}),
)

CONVERGENCE_SIZE = SceneSize(960, 540, frames=32, voxel_size=0.003)
CONVERGENCE_ITERATIONS = 300
MEASURE_AT = (0, 10, 25, 50, 100, 150, 200, 300)
DENSE, REFERENCE = "dense start", "3DGS"

# Runs of different lengths are different runs: the learning rates fall along a whole run.
LENGTH_SIZE = SceneSize(1600, 900, frames=40, voxel_size=0.003)
LENGTHS = (100, 1000, 12_000)
LENGTH_MESH = Path("meshes/ycb_mustard_bottle/ycb_mustard_bottle.glb")


def bench_options(
    size: SceneSize = OPTIONS_SIZE, iterations: int = OPTIONS_ITERATIONS
) -> list[Result]:
    """Return time of a step, PSNR of held-out views and number of Gaussians, one option at a time."""
    results = []
    with _recorded(size) as scene, progress(len(OPTIONS), "Training", "option") as bar:
        for name, values in OPTIONS:
            config = TrainConfig(stop=Stop(iterations=iterations), **values)
            (end,) = scene.train(config)
            labels = {"image": size.image, "start": len(scene.points), "iterations": iterations}
            labels |= {"threads": default_threads(), "option": name}
            values = {
                "step [ms]": 1e3 * end.seconds / max(1, iterations),
                "PSNR on the object [dB]": end.psnr,
                "Gaussians": end.splats,
            }
            results.append(Result(labels, values))
            bar.update()
    return results


def bench_convergence(
    size: SceneSize = CONVERGENCE_SIZE, iterations: int = CONVERGENCE_ITERATIONS
) -> list[Result]:
    """Return seconds and PSNR of the held-out views along a run: our settings, then those of 3DGS."""
    dense = TrainConfig(stop=Stop(iterations=iterations))
    reference = replace(dense, rates=Rates(**asdict(REFERENCE_RATES)))
    init = InitConfig()
    runs: tuple[tuple[str, TrainConfig, Mapping[str, float]], ...] = (
        (DENSE, dense, {"opacity": init.seed_opacity, "width": init.seed_width}),
        (REFERENCE, reference, {"opacity": STRATEGIES["default"].opacity}),
    )
    results = []
    with _recorded(size) as scene, progress(len(runs), "Training", "run") as bar:
        for name, config, start in runs:
            shared = {"image": size.image, "splats": len(scene.points)}
            shared |= {"threads": default_threads(), "settings": name}
            results += [
                Result(
                    shared | {"iteration": at.iteration},
                    {"seconds": round(at.seconds, 2), "PSNR on the object [dB]": at.psnr},
                )
                for at in scene.train(config, MEASURE_AT, start=start)
            ]
            bar.update()
    return results


def convergence_charts(results: Sequence[Result]) -> list[Chart]:
    """Return quality against seconds and against iterations."""
    names = dict.fromkeys(result.labels["settings"] for result in results)
    curves = {name: [r for r in results if r.labels["settings"] == name] for name in names}
    first = results[0].labels
    title = f"{first['splats']:,} Gaussians from depth, {first['image']} px"
    return [
        Chart(
            f"convergence_{key}",
            f"{title}, {first['threads']} threads",
            [
                Curve(
                    name,
                    [{**r.labels, **r.values}[key] for r in curve],
                    [r.values["PSNR on the object [dB]"] for r in curve],
                )
                for name, curve in curves.items()
            ],
            x_label,
            "PSNR on the object, held-out views [dB]",
        )
        for key, x_label in (("seconds", "training time [s]"), ("iteration", "iterations"))
    ]


def bench_paper_length(
    size: SceneSize = LENGTH_SIZE, lengths: Sequence[int] = LENGTHS
) -> list[Result]:
    """Return training seconds and PSNR of the held-out views for runs of each length.

    On the mustard bottle of the sample data where it is present, else on the built-in object.
    """
    mesh = sample_data() / LENGTH_MESH
    mesh = mesh if mesh.is_file() else None
    results = []
    with _recorded(size, mesh) as scene, progress(sum(lengths), "Training", "step") as bar:
        for count in lengths:
            (end,) = scene.train(TrainConfig(stop=Stop(iterations=count)), after_step=bar.update)
            labels = {
                "iterations": f"{count:,}",
                "object": mesh.stem if mesh else "built-in vase",
                "image": size.image,
                "training views": len(scene.frames),
                "splats": end.splats,
                "threads": default_threads(),
            }
            values = {"training [s]": end.seconds, "PSNR on the object [dB]": end.psnr}
            results.append(Result(labels, values))
    return results


@dataclass(frozen=True)
class Milestone:
    """State of a run: steps taken, training seconds, PSNR of the held-out views [dB], Gaussians."""

    iteration: int
    seconds: float
    psnr: float
    splats: int


@dataclass(frozen=True)
class _Scene:
    """A recording split into training frames and held-out views, and the points that its depth gives."""

    frames: list[Frame]
    test_views: list[TestView]
    points: PointCloud

    def train(
        self,
        config: TrainConfig,
        measure_at: Collection[int] = (),
        start: Mapping[str, float] | None = None,
        after_step: Callable[[], object] = lambda: None,
    ) -> list[Milestone]:
        """Train, and measure at some iterations and at the end; measuring takes no training seconds.

        Args:
            config: of the training.
            measure_at: iterations.
            start: opacity and width of the first Gaussians; default: those for a dense start.
            after_step: called after each step, to show progress.
        """
        init = InitConfig()
        start = start or {"opacity": init.seed_opacity, "width": init.seed_width}
        seeds = seed_gaussians(self.points, config.usual_sh_degree, **start)
        views = open_views(self.frames, config)
        trainer = Trainer(seeds, views, config)
        milestones = []
        for step in range(config.stop.iterations + 1):
            if step in measure_at or step == config.stop.iterations:
                renderings = render_views(trainer.gaussians, self.test_views)
                scores = score_views(renderings, self.test_views)
                psnr = np.mean([score.psnr_object for score in scores])
                splats = len(trainer.gaussians)
                milestones.append(Milestone(step, trainer.seconds, float(psnr), splats))
            if step < config.stop.iterations:
                trainer.step()
                after_step()
        views.close()
        return milestones


@contextmanager
def _recorded(size: SceneSize, mesh: Path | None = None) -> Iterator[_Scene]:
    """Record a mesh, by default the built-in object, and initialize from its depth."""
    from digs_warp.sim.record.record import SimulateConfig, simulate

    config = SimulateConfig(
        mesh=mesh,
        object_size=OBJECT_SIZE if mesh else None,
        frames=size.frames,
        width=size.width,
        height=size.height,
        tier="law",
    )
    with tempfile.TemporaryDirectory() as folder:
        capture = simulate(config, Path(folder) / "capture")
        frames, test_frames = capture.split()
        points = initial_points(frames, InitConfig(voxel_size=size.voxel_size))
        yield _Scene(frames, load_test_views(test_frames), points)
