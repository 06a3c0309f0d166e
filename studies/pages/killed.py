"""What a killed worker costs, for docs/many-scenes.md: 200 small reconstructions, in ten minutes.

They run in one process, and on two workers of Dask of which one is killed.
"""

import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.engines.task import Results
from digs_warp.record.files import read_json, to_json, write_atomically
from digs_warp.study.table import Table
from scripts.page_marks import fill
from studies.pages import measured_on

COUNT, FRAMES = 200, 6
SIZE = ("--width", "96", "--height", "54", "--tier", "law", "--samples-per-pixel", "1")
STEPS = 30
LOOK_EVERY = 0.2  # seconds between two looks at the processes

# What is compared: Gaussians, start points and rendered views; the other files of a result hold times.
COMPARED = (".npz", ".png")


def main() -> None:
    """Measure, and write the table."""
    with tempfile.TemporaryDirectory() as folder:
        table = trial(Path(folder)).markdown()
    fill("many-scenes.md", "killed", f"{table}\n\n{measured_on()}")


@dataclass(frozen=True)
class Ran:
    """What a command took.

    Attributes:
        seconds: from its start to its end.
        cpu_seconds: of all its processes, also of those that were killed.
        killed_after: how many results there were when a worker was killed; None: none was.
    """

    seconds: float
    cpu_seconds: float
    killed_after: int | None


def trial(folder: Path, count: int = COUNT, iterations: int = STEPS) -> Table:
    """Return the table of both runs, after comparing what they left.

    Args:
        folder: an empty one, for recordings and results.
        count: of reconstructions.
        iterations: training steps of each.
    """
    digs_warp("simulate", "--out", folder / "walk", "--frames", str(count * FRAMES), *SIZE)
    captures = cut(folder / "walk", folder / "captures", count)
    one, two = folder / "one", folder / "two"
    reconstruct = [
        *("reconstruct", *captures, "--iterations", str(iterations), "--case-threads", "1")
    ]
    # Kernels are compiled before anything is timed.
    digs_warp(
        "reconstruct", captures[0], "--iterations", str(iterations), "--out", folder / "first"
    )
    local = measured([*reconstruct, "--out", one], one)
    dask = measured(
        [*reconstruct, "--out", two, "--engine", "dask", "--workers", "2"], two, count // 2
    )
    if dask.killed_after is None:
        raise RuntimeError("no worker was killed: there was none at that time")
    first, second = files(one), files(two)
    same = sum(first[name] == content for name, content in second.items() if name in first)
    names = first.keys() | second.keys()
    rows = [
        ["reconstructions that ended well", *(str(finished(each)) for each in (one, two))],
        ["worker killed", "–", f"after {dask.killed_after} of {count}"],  # noqa: RUF001
        ["seconds", *(f"{each.seconds:.0f}" for each in (local, dask))],
        ["CPU seconds", *(f"{each.cpu_seconds:.0f}" for each in (local, dask))],
        ["share of the time of one process", "1", f"{dask.seconds / local.seconds:.2f}"],
        ["files with the same bits as from one process", "–", f"{same} of {len(names)}"],  # noqa: RUF001
    ]
    return Table("killed", ["", "one process", "two workers of Dask, one killed"], rows)


def cut(walk: Path, folder: Path, count: int) -> list[Path]:
    """Write ``count`` captures, each with frames from all along a recording, and return their folders."""
    index = read_json(walk / INDEX_NAME, "capture index")
    made = []
    for number in range(count):
        place = folder / f"{number:03d}"
        frames = index["frames"][number::count]
        for frame in frames:
            for name in [str(value) for key, value in frame.items() if key.endswith("_path")]:
                (place / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(walk / name, place / name)
        write_atomically(place / INDEX_NAME, to_json(index | {"frames": frames}).encode())
        made.append(place)
    return made


def measured(words: Sequence[str | Path], out: Path, kill_after: int | None = None) -> Ran:
    """Run a command of digs-warp; when ``out`` has that many results, kill a worker of Dask with SIGKILL."""
    start, killed_after = time.monotonic(), None
    process = subprocess.Popen(_command(words))
    processor = _Processor(psutil.Process(process.pid))
    while process.poll() is None:
        children = processor.look()
        if kill_after is not None and killed_after is None and finished(out) >= kill_after:
            if worker := _waiting_for_a_child(children):
                worker.send_signal(signal.SIGKILL)
                killed_after = finished(out)
        time.sleep(LOOK_EVERY)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, process.args)
    return Ran(time.monotonic() - start, processor.seconds, killed_after)


def _waiting_for_a_child(processes: list[psutil.Process]) -> psutil.Process | None:
    """Return a worker: a reconstruction runs in a child of it."""
    for process in processes:
        try:
            if "digs_warp.engines.processes" in " ".join(process.cmdline()):
                return process.parent()
        except psutil.NoSuchProcess:
            continue
    return None


class _Processor:
    """Adds up the CPU seconds of a process and all its descendants while they live."""

    def __init__(self, root: psutil.Process) -> None:
        self._root = root
        self._seconds: dict[tuple[int, float], float] = {}

    def look(self) -> list[psutil.Process]:
        """Note the seconds so far; return the descendants."""
        try:
            children = self._root.children(recursive=True)
        except psutil.NoSuchProcess:
            return []
        for each in (self._root, *children):
            try:
                times = each.cpu_times()
                self._seconds[each.pid, each.create_time()] = times.user + times.system
            except psutil.NoSuchProcess:
                continue
        return children

    @property
    def seconds(self) -> float:
        """The sum of all processes that were seen."""
        return sum(self._seconds.values())


def files(out: Path) -> dict[Path, bytes]:
    """Return what is compared of all results in a folder, by the names below it."""
    found = (path for path in out.rglob("*") if path.suffix in COMPARED)
    return {path.relative_to(out): path.read_bytes() for path in found}


def finished(out: Path) -> int:
    """Return how many cases have a result without an error."""
    results = Results(out)
    return sum(results.is_done(key) for key in results.records)


def digs_warp(*words: str | Path) -> None:
    """Run a command to its end."""
    subprocess.run(_command(words), check=True)


def _command(words: Sequence[str | Path]) -> list[str]:
    return [sys.executable, "-m", "digs_warp", *map(str, words)]
