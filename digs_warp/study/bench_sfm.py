"""`digs-warp bench sfm`: what each choice of structure from motion costs, and how exact the poses get.

Photographs of the built-in object in its room, from the walk that the simulator takes, without image noise
and rolling shutter: the errors are those of structure from motion alone (`sfm-sensor` measures those of the
sensor). Every case starts from an empty workspace.
"""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Frame
from digs_warp.device.parallel import default_threads
from digs_warp.record.progress import progress
from digs_warp.sfm.config import SfmConfig
from digs_warp.sfm.estimate import structure_from_motion
from digs_warp.sfm.evaluate import pose_errors
from digs_warp.study.results import Result
from digs_warp.study.sfm_photographs import Photographs, photograph_walk

MM_PER_METRE = 1000.0


SMALL = Photographs(48, 800, 450)
FULL = Photographs(200, 1600, 900)  # the recording of the paper, at its training size

# Photographs of the paper's size take minutes to render: they stay for the next time.
KEPT = Path(tempfile.gettempdir()) / "digs-warp-photographs"

# One choice changed at a time.
DEFAULT = SfmConfig(pairing="sequential")
CHOICES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("default", {}),
    ("exhaustive pairs", {"pairing": "exhaustive"}),
    ("half the overlap", {"overlap": 3}),
    ("twice the overlap", {"overlap": 12}),
    ("no loops", {"loop_images": 0}),
    ("1000 features", {"features": 1000}),
    ("4000 features", {"features": 4000}),
    ("features at 400 px", {"feature_size": 400}),
    ("not enlarged", {"double_size": False}),
    ("global mapper", {"mapper": "global"}),
)
# Of the large recording; small photographs are not reduced.
FULL_CHOICES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("default", {}),
    ("features at 1600 px", {"feature_size": 1600}),
)


def bench_sfm() -> list[Result]:
    """Return times [s], memory [MB] and errors of all choices on a small recording."""
    with tempfile.TemporaryDirectory() as folder:
        frames = photograph_walk(SMALL.session(), Path(folder))
        return measure(frames, _cases(CHOICES), {"images": str(SMALL)})


def bench_sfm_full() -> list[Result]:
    """Return the same for a recording of the paper's size, reduced for the features and not reduced."""
    frames = photograph_walk(FULL.session(), KEPT / str(FULL).replace(" ", "-"))
    return measure(frames, _cases(FULL_CHOICES), {"images": str(FULL)})


def _cases(choices: Sequence[tuple[str, dict[str, Any]]]) -> list[tuple[str, SfmConfig]]:
    return [(name, replace(DEFAULT, **change)) for name, change in choices]


def measure(
    frames: Sequence[Frame], cases: Sequence[tuple[str, SfmConfig]], settings: dict[str, Any]
) -> list[Result]:
    """Run every case on the photographs; ``settings`` join those of every result."""
    shared = settings | {"threads": default_threads()}
    results: list[Result] = []
    with tempfile.TemporaryDirectory() as folder, progress(len(cases), "Measuring", "case") as bar:
        for number, (name, config) in enumerate(cases):
            numbers = run_case(frames, config, Path(folder) / f"workspace{number}")
            results += [
                Result(key, value, unit, {"choice": name} | shared)
                for (key, unit), value in numbers.items()
            ]
            bar.update()
    return results


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
