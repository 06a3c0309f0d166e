"""`digs-warp bench sfm`: what each choice of structure from motion costs, and how exact the poses get.

Photographs of the built-in object in its room, from the walk that the simulator takes, without image noise
and rolling shutter: the errors are those of structure from motion alone. Every case starts from an empty
workspace.
"""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.camera import Camera
from digs_warp.capture import Frame
from digs_warp.checks import DigsError
from digs_warp.images import write_image
from digs_warp.log import progress
from digs_warp.parallel import default_threads
from digs_warp.sfm.config import SfmConfig
from digs_warp.sfm.estimate import structure_from_motion
from digs_warp.sfm.evaluate import pose_errors
from digs_warp.study.results import Result

MM_PER_METRE = 1000.0


@dataclass(frozen=True)
class Photographs:
    """How many photographs of which size [px], over three orbits at about 0.9 m."""

    count: int
    width: int
    height: int


SMALL = Photographs(48, 800, 450)
FULL = Photographs(200, 1600, 900)  # the recording of the paper, at its training size

# One choice changed at a time.
DEFAULT = SfmConfig(pairing="sequential")
CHOICES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("default", {}),
    ("exhaustive pairs", {"pairing": "exhaustive"}),
    ("half the overlap", {"overlap": 5}),
    ("no loops", {"loop_images": 0}),
    ("1500 features", {"features": 1500}),
    ("features at 400 px", {"feature_size": 400}),
    ("not enlarged", {"double_size": False}),
    ("global mapper", {"mapper": "global"}),
)


def bench_sfm() -> list[Result]:
    """Return times [s], memory [MB] and errors of all choices on a small recording."""
    return measure(SMALL, [(name, replace(DEFAULT, **change)) for name, change in CHOICES])


def bench_sfm_full() -> list[Result]:
    """Return the same for the default settings on a recording of the paper's size."""
    return measure(FULL, [("default", DEFAULT)])


def measure(photographs: Photographs, cases: Sequence[tuple[str, SfmConfig]]) -> list[Result]:
    """Photograph once, then run every case."""
    results: list[Result] = []
    size = f"{photographs.count} of {photographs.width}x{photographs.height}"
    shared = {"images": size, "threads": default_threads()}
    with tempfile.TemporaryDirectory() as folder:
        frames = photograph_walk(photographs, Path(folder))
        with progress(len(cases), "Measuring", "case") as bar:
            for number, (name, config) in enumerate(cases):
                numbers = run_case(frames, config, Path(folder) / f"workspace{number}")
                results += [
                    Result(key, value, unit, {"choice": name} | shared)
                    for (key, unit), value in numbers.items()
                ]
                bar.update()
    return results


def photograph_walk(photographs: Photographs, folder: Path) -> list[Frame]:
    """Render the left eye's photographs along the walk; the frames carry the true cameras."""
    from sim.config import SimulateConfig
    from sim.session import load_inputs, prepare_session

    config = SimulateConfig(
        frames=photographs.count, width=photographs.width, height=photographs.height
    )
    session = prepare_session(config, load_inputs(config))
    frames = []
    with progress(photographs.count, "Photographing", "image") as bar:
        for number, moment in enumerate(session.moments):
            camera = Camera(session.rig.intrinsics, session.walk.pose(moment))
            image, _ = session.renderer.render_image(camera, samples_per_pixel=2, seed=number)
            path = folder / "images" / f"{number:04d}.png"
            write_image(path, image)
            frames.append(Frame(path.stem, camera, moment, {"file_path": path}))
            bar.update()
    return frames


def run_case(
    frames: Sequence[Frame], config: SfmConfig, workspace: Path
) -> dict[tuple[str, str], float]:
    """Return the numbers of one case by (name, unit); of a failed one only its time."""
    forget_peak_memory()
    start, cpu = time.perf_counter(), time.process_time()
    try:
        result = structure_from_motion(frames, config, workspace)
    except DigsError:
        return {("total", "s"): time.perf_counter() - start, ("registered", "images"): 0.0}
    total, cpu = time.perf_counter() - start, time.process_time() - cpu
    errors = pose_errors(result.model, frames)
    quality = asdict(result.quality)
    return {
        ("features", "s"): result.seconds["features"],
        ("pairs", "s"): result.seconds["pairs"],
        ("match", "s"): result.seconds["match"],
        ("map", "s"): result.seconds["map"],
        ("total", "s"): total,
        ("all cores", "s"): cpu,
        ("peak", "MB"): peak_memory_mb(),
        ("registered", "images"): quality["registered"],
        ("points", "points"): quality["points"],
        ("reprojection", "px"): quality["reprojection_error_px"],
        ("center median", "mm"): MM_PER_METRE * float(np.median(errors.centers_m)),
        ("center worst", "mm"): MM_PER_METRE * float(errors.centers_m.max()),
        ("rotation median", "deg"): float(np.median(errors.rotations_deg)),
    }


def peak_memory_mb() -> float:
    """Return the most memory [MB] this process has held since `forget_peak_memory`; 0 where unknown."""
    status = Path("/proc/self/status")
    if not status.is_file():
        return 0.0
    line = next(li for li in status.read_text().splitlines() if li.startswith("VmHWM"))
    return float(line.split()[1]) / 1024


def forget_peak_memory() -> None:
    """Start counting `peak_memory_mb` anew, where the system allows it."""
    try:
        Path("/proc/self/clear_refs").write_text("5")  # Linux: the peak starts again from here
    except OSError:
        pass  # the peak then counts from the start of the process
