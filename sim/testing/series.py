"""Recordings at rising sensor noise, kept between tests, and how errors grow with it."""

import hashlib
import math
import re
import shutil
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.record.disk import rename
from digs_warp.record.fields import shown
from digs_warp.record.files import to_json
from digs_warp.record.lock import taking_turns
from digs_warp.record.run_log import versions
from digs_warp.sim.testing.curve import DegradationCurve
from digs_warp.sim.testing.sources import KEY_LENGTH, NoiseSource

_KEY = re.compile(f"[0-9a-f]{{{KEY_LENGTH}}}")

# Folders of this package and the files below it whose code decides the bytes of a capture.
_SOURCES = ("*.py", "data/*.py", "device/*.py", "record/*.py", "sim/**/*.py")


@dataclass(frozen=True)
class CaptureCache:
    """A folder of captures, each made once.

    The name of a capture is the key of its source. Captures lie in a folder named by a hash of the code and
    packages that make them; folders of other code are removed.
    """

    folder: Path

    def capture(self, source: NoiseSource, strength: float) -> Capture:
        """Return the capture at a strength; makes it when it is not there yet."""
        folder = self.folder / _code_key() / source.key(strength)
        if not folder.is_dir():
            with taking_turns(folder):  # test processes may run side by side: one makes it
                if not folder.is_dir():
                    self._remove_others(folder.parent)
                    # A killed run left a part there.
                    unfinished = folder.with_name(f".{folder.name}.unfinished")
                    source.write(strength, unfinished)
                    rename(unfinished, folder)
        return read_capture(folder)

    def _remove_others(self, current: Path) -> None:
        """Delete the captures of other code; what is not named like them is none of ours."""
        for other in self.folder.iterdir():
            if other != current and _KEY.fullmatch(other.name) and not other.is_symlink():
                shutil.rmtree(other, ignore_errors=True)


@cache
def _code_key() -> str:
    root = Path(__file__).parents[2]
    digest = hashlib.sha256(to_json(versions()).encode())
    for path in sorted(path for pattern in _SOURCES for path in root.glob(pattern)):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:KEY_LENGTH]


@dataclass(frozen=True)
class NoiseSeries:
    """Captures of the same walk around the same object; only the sensor's errors differ.

    Iterating gives (strength, capture) in rising order; captures are made when they are first needed.

    Attributes:
        source: makes them.
        strengths: factors on the sensor's errors; 0: perfect depth, or a recording as it is; 1: errors as
            those of the real sensor.
        cache: keeps the captures.
        on_curve: called with the name of each function that was measured, and its curve.
    """

    source: NoiseSource
    strengths: tuple[float, ...]
    cache: CaptureCache
    on_curve: Callable[[str, DegradationCurve], None] = lambda _name, _curve: None

    def __post_init__(self) -> None:
        check_strengths(self.strengths)

    def __iter__(self) -> Iterator[tuple[float, Capture]]:
        return ((strength, self.capture(strength)) for strength in self.strengths)

    def capture(self, strength: float) -> Capture:
        """Return the capture at one strength."""
        return self.cache.capture(self.source, strength)

    def measure(self, error: Callable[[Capture], float]) -> DegradationCurve:
        """Return how ``error(capture)`` grows with the noise; smaller is better."""
        __tracebackhide__ = True
        errors = []
        for strength, capture in self:
            try:
                errors.append(_number(error(capture)))
            except Exception as failure:
                failure.add_note(f"on the capture at sensor noise strength {strength:g}")
                raise
        curve = DegradationCurve(self.strengths, tuple(errors))
        self.on_curve(getattr(error, "__name__", type(error).__name__), curve)
        return curve


def _number(found: object) -> float:
    __tracebackhide__ = True
    try:
        return float(found)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError):
        raise DigsError(
            f"measure: the function returned {shown(found)}, expected one number: its error"
        ) from None


def check_strengths(strengths: Iterable[float]) -> tuple[float, ...]:
    """Return the strengths, or raise a `DigsError` when they do not rise from 0 or above."""
    found = tuple(strengths) if isinstance(strengths, Iterable) else (strengths,)
    if not all(isinstance(each, int | float) and math.isfinite(each) for each in found):
        raise DigsError(f"strengths {shown(found)}: expected finite numbers")
    if not found or found[0] < 0 or not all(a < b for a, b in pairwise(found)):
        raise DigsError(f"strengths {shown(found)}: expected rising numbers, the first >= 0")
    return found
