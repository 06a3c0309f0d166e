"""How recording and reconstructing grow with the frames and with the pixels, stage by stage.

Each has a process of its own, in which nothing else counts as memory. CPU seconds, not those that
pass: they depend less on what else the machine does. A stage that is linear has an exponent of 1, or less
where what it does once still counts.
"""

import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from studies.budget import stage_times
from studies.results import Result
from studies.timing import Stopwatch

# Frames of 160x90 pixels; and widths of 20 frames.
FRAMES, WIDTHS = (20, 60, 200, 1000), (640, 1280, 1920)
ITERATIONS = 20
MEMORY = "peak memory [MB]"
# Stages of the tables; the others are in the sum.
SHOWN = ("record", "initialize", "train", "reconstruct", MEMORY)

Cost = dict[str, float]  # stage -> CPU seconds; MEMORY -> megabytes


def bench_growth(only: Sequence[str] = ("frames", "pixels")) -> list[Result]:
    """Return the cost of each stage by frames, by pixels, or by both."""
    measured_alone(FRAMES[0], 160)  # compiles the kernels
    found = []
    if "frames" in only:
        costs = [measured_alone(frames, 160) for frames in FRAMES]
        found += results("frames", [f"{n} frames" for n in FRAMES], FRAMES, costs)
    if "pixels" in only:
        costs = [measured_alone(20, width) for width in WIDTHS]
        pixels = [width**2 * 9 / 16 for width in WIDTHS]
        found += results("pixels", [f"{n} px wide" for n in WIDTHS], pixels, costs)
    return found


def results(
    table: str, columns: Sequence[str], sizes: Sequence[float], costs: Sequence[Cost]
) -> list[Result]:
    """Return a row for each stage: its cost at each size, and the exponent between the two largest."""
    rows = []
    for stage in (name for name in SHOWN if name in costs[-1]):
        values = {c: cost.get(stage, 0.0) for c, cost in zip(columns, costs, strict=True)}
        before, last = (max(cost.get(stage, 0.0), 1e-3) for cost in costs[-2:])
        exponent = float(np.log(last / before) / np.log(sizes[-1] / sizes[-2]))
        unit = stage if stage == MEMORY else f"{stage} [CPU s]"
        rounded = {column: round(value, 2) for column, value in values.items()}
        rows.append(Result({"stage": unit}, {**rounded, "exponent": round(exponent, 2)}, table))
    return rows


def measured_alone(frames: int, width: int) -> Cost:
    """Record and reconstruct, each in a new process.

    Raises:
        DigsError: one of them failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        return _alone(recorded, folder, frames, width) | _alone(reconstructed, folder)


def _alone(work: Callable[..., Cost], *given: str | int) -> Cost:
    words = f"import json; from {__name__} import {work.__name__} as work; "
    words += f"print(json.dumps(work(*{given})))"
    done = subprocess.run(
        [sys.executable, "-c", words], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise DigsError(f"growth: {work.__name__}{given} failed: {done.stderr.strip()[-500:]}")
    return json.loads(done.stdout.splitlines()[-1])


def recorded(folder: str, frames: int, width: int) -> Cost:
    """Make a recording in a folder."""
    from digs_warp.sim.config import SimulateConfig
    from digs_warp.sim.record.record import simulate
    from digs_warp.study.engine.case import STUDIED_CAMERA

    with (watch := Stopwatch()):
        config = SimulateConfig(profile=STUDIED_CAMERA, width=width, frames=frames)
        simulate(config, Path(folder, "capture"))
    return {"record": watch.cpu_seconds}


def reconstructed(folder: str) -> Cost:
    """Reconstruct the recording in a folder."""
    from digs_warp.data.capture import read_capture
    from digs_warp.pipeline.config import ReconstructConfig
    from digs_warp.pipeline.reconstruct import reconstruct
    from digs_warp.train.config import Stop, TrainConfig

    config = ReconstructConfig(train=TrainConfig(stop=Stop(iterations=ITERATIONS)))
    with stage_times() as (_, stages), (watch := Stopwatch()):
        capture = read_capture(Path(folder, "capture"))
        reconstruct(capture, config, Path(folder, "result"))
    cost = {stage.partition(": ")[2]: seconds for stage, seconds in stages.items()}
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return cost | {"reconstruct": watch.cpu_seconds, MEMORY: peak / 1e6}
