"""How fast recordings are made, for `python -m studies sim`: frames, CPU time, cores at work, memory.

Each size is recorded in a process that does nothing else; an earlier one has compiled the kernels.
Everything that a user waits for counts: loading, the plan, all frames with their files.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.study.timing import Stopwatch
from studies.results import Result
from studies.timing import peak_memory

WIDTHS = (640, 1280)
FRAMES, WARM_UP = 60, 2


@dataclass(frozen=True)
class Recorded:
    """What a recording took: wall time and CPU time of all threads [s], most memory held [bytes]."""

    frames: int
    seconds: float
    cpu_seconds: float
    peak: int


def bench_recording(widths: Sequence[int] = WIDTHS, frames: int = FRAMES) -> list[Result]:
    """Return what the built-in object with the default sensor takes, by image width [px]."""
    for width in widths[:1]:
        recorded_alone(width, WARM_UP)
    return [result_of(width, recorded_alone(width, frames)) for width in widths]


def recorded_alone(width: int, frames: int) -> Recorded:
    """Make a recording in a new process.

    Raises:
        DigsError: it failed.
    """
    code = f"from {__name__} import tell_recording; tell_recording({width}, {frames})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise DigsError(f"recording {width} pixels wide failed: {done.stderr.strip()[-500:]}")
    return Recorded(**json.loads(done.stdout.splitlines()[-1]))


def tell_recording(width: int, frames: int) -> None:
    """Make a recording in this process, and write what it took to standard output, as JSON."""
    with tempfile.TemporaryDirectory() as folder:
        made = _recorded(Path(folder, "capture"), width, frames)
    sys.stdout.write(json.dumps(asdict(made)) + "\n")


def _recorded(folder: Path, width: int, frames: int) -> Recorded:
    watch = Stopwatch()
    with peak_memory() as memory, watch:
        simulate(SimulateConfig(width=width, frames=frames), folder)
    return Recorded(frames, watch.seconds, watch.cpu_seconds, memory.peak)


def result_of(width: int, made: Recorded) -> Result:
    """Return the row of a recording."""
    return Result(
        {"width": width, "frames": made.frames},
        {
            "frames/s": made.frames / made.seconds,
            "CPU [s/frame]": made.cpu_seconds / made.frames,
            "cores busy": made.cpu_seconds / made.seconds,
            "peak memory [MB]": made.peak / 1e6,
        },
        "recording",
    )
