"""What a part of the check is given, and what it leaves behind."""

import json
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import warp as wp

from digs_warp.record.files import add_line
from digs_warp.splat.backend import CooperativeBackend, RasterBackend


@dataclass(frozen=True)
class Run:
    """What is checked.

    Attributes:
        device: Warp device that is compared with the CPU. The CPU itself: its run of the kernels for CUDA.
        splats: of the scenes that are compared and trained.
        width: of their images [px].
        height: of their images [px].
        steps: of the training.
        timed: splats of the scenes that are timed.
        timed_width: of the images that are timed [px].
        timed_height: of the images that are timed [px].
    """

    device: str
    splats: int
    width: int
    height: int
    steps: int
    timed: tuple[int, ...]
    timed_width: int
    timed_height: int

    @property
    def has_gpu(self) -> bool:
        """Whether the device is not the CPU."""
        return self.device != "cpu"

    @property
    def backend(self) -> RasterBackend | None:
        """The kernels that are compared with those for CPUs; None: those that the device gets anyway."""
        return None if self.has_gpu else CooperativeBackend()


@dataclass
class Findings:
    """What a part found.

    Attributes:
        part: its name.
        seconds: how long it took.
        figures: by name, numbers or words.
        failures: one line each, or a traceback.
    """

    part: str
    seconds: float = 0.0
    figures: dict[str, object] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)

    def note(self, name: str, value: object, aloud: bool = True) -> None:
        """Keep a figure, and print it at once."""
        self.figures[name] = value
        if aloud:
            say(f"  {name}: {value:.4g}" if isinstance(value, float) else f"  {name}: {value}")

    def at_most(self, name: str, value: float, limit: float, aloud: bool = True) -> None:
        """Keep a figure that must not be above a limit; NaN is."""
        self.note(name, float(value), aloud or not value <= limit)
        if not value <= limit:
            self.failures.append(f"{self.part}: {name} is {value:.4g}, at most {limit:g} expected")

    def at_least(self, name: str, value: float, limit: float) -> None:
        """Keep a figure that must not be below a limit; NaN is."""
        self.note(name, float(value))
        if not value >= limit:
            self.failures.append(f"{self.part}: {name} is {value:.4g}, at least {limit:g} expected")

    def all_at_most(self, name: str, values: dict[str, float], limit: float) -> None:
        """Keep figures of one limit; only the largest is printed, and what is above the limit."""
        for part, value in values.items():
            self.at_most(f"{name}: {part}", value, limit, aloud=False)
        largest = max(values, key=lambda part: values[part])
        say(f"  {name}: largest of {len(values)} is {values[largest]:.3g} ({largest})")

    def require(self, name: str, holds: bool) -> None:
        """Keep whether something holds that must."""
        self.note(name, "yes" if holds else "NO")
        if not holds:
            self.failures.append(f"{self.part}: {name}: no")

    def attempt(self, name: str, work: Callable[[], None]) -> None:
        """Do one thing of several: if it fails, the traceback is kept and the others still run."""
        try:
            work()
        except Exception:
            self.failures.append(f"{self.part}: {name}\n{traceback.format_exc()}")
            say(self.failures[-1])


Part = Callable[[Run, Findings], None]


def run_part(name: str, part: Part, run: Run) -> Findings:
    """Run a part; its errors are findings, too."""
    say(f"[{name}]")
    findings = Findings(name)
    start = time.perf_counter()

    def work() -> None:
        part(run, findings)
        wp.synchronize()  # an error of a kernel is told only here

    findings.attempt("stopped", work)
    findings.seconds = time.perf_counter() - start
    say(f"  {name}: {'FAILED' if findings.failures else 'ok'}, {findings.seconds:.1f} s")
    return findings


def append(findings: Findings, path: Path) -> None:
    """Add the findings to a file as one line of JSON."""
    add_line(path, json.dumps(asdict(findings)))


def read(path: Path) -> list[Findings]:
    """Return the findings in a file, in order."""
    lines = path.read_text().splitlines() if path.is_file() else []
    return [Findings(**json.loads(line)) for line in lines]


def say(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    """Return |found - expected| / |expected|, by Euclidean norms; 0 where both are 0."""
    difference = float(np.linalg.norm(np.asarray(found, np.float64) - expected))
    size = float(np.linalg.norm(np.asarray(expected, np.float64)))
    return difference / size if size > 0 else difference
