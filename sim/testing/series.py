"""One simulated walk at rising sensor noise; its captures are kept between test runs."""

import hashlib
import math
import re
import shutil
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property
from itertools import pairwise
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.record.disk import rename
from digs_warp.record.fields import shown
from digs_warp.record.files import to_json
from digs_warp.record.lock import taking_turns
from digs_warp.record.run_log import versions
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.inputs import load_inputs
from digs_warp.sim.record import simulate
from digs_warp.sim.session import Session, prepare_session
from digs_warp.sim.testing.curve import DegradationCurve

KEY_LENGTH = 20  # hexadecimal digits
_KEY = re.compile(f"[0-9a-f]{{{KEY_LENGTH}}}")

# Folders of this package and the files below it whose code decides the bytes of a capture.
_SOURCES = ("*.py", "data/*.py", "device/*.py", "record/*.py", "sim/**/*.py")


@dataclass(frozen=True)
class CaptureCache:
    """A folder of captures, each simulated once.

    The name of a capture is a hash of its settings and of the files they name. Captures lie in a folder
    named by a hash of the simulator's code and packages; folders of other code are removed.
    """

    folder: Path

    def capture(
        self, config: SimulateConfig, session: Callable[[], Session] | None = None
    ) -> Capture:
        """Return the capture of these settings; simulates it when it is not there yet.

        Args:
            config: settings.
            session: returns what `digs_warp.sim.record.simulate` may use instead of loading the scene
                again; only called when something is simulated.
        """
        folder = self.folder / _code_key() / _key(config)
        if not folder.is_dir():
            with taking_turns(folder):  # test processes may run side by side: one simulates
                if not folder.is_dir():
                    self._remove_others(folder.parent)
                    self._simulate(config, folder, session() if session else None)
        return read_capture(folder)

    def _simulate(self, config: SimulateConfig, folder: Path, session: Session | None) -> None:
        unfinished = folder.with_name(
            f".{folder.name}.unfinished"
        )  # a killed run left a part there
        simulate(config, unfinished, resume=True, session=session)
        rename(unfinished, folder)

    def _remove_others(self, current: Path) -> None:
        """Delete the captures of other code; what is not named like them is none of ours."""
        for other in self.folder.iterdir():
            if other != current and _KEY.fullmatch(other.name) and not other.is_symlink():
                shutil.rmtree(other, ignore_errors=True)


@dataclass(frozen=True)
class NoiseSeries:
    """Captures of the same walk around the same object; only the sensor's errors differ.

    Iterating gives (strength, capture) in rising order; captures are simulated when they are first needed.

    Attributes:
        config: of the recording at strength 1.
        strengths: factors on the sensor's errors; 0: perfect depth, 1: as the real sensor.
        cache: keeps the captures.
        on_curve: called with the name of each function that was measured, and its curve.
    """

    config: SimulateConfig
    strengths: tuple[float, ...]
    cache: CaptureCache
    on_curve: Callable[[str, DegradationCurve], None] = lambda _name, _curve: None

    def __post_init__(self) -> None:
        check_strengths(self.strengths)

    def __iter__(self) -> Iterator[tuple[float, Capture]]:
        return ((strength, self.capture(strength)) for strength in self.strengths)

    def capture(self, strength: float) -> Capture:
        """Return the capture at one strength."""
        config = replace(self.config, strength=float(strength))
        return self.cache.capture(config, lambda: self._session)

    @cached_property
    def _session(self) -> Session:
        """Scene, light and walk: the same at every strength, and slow to load."""
        return prepare_session(self.config, load_inputs(self.config))

    def measure(self, error: Callable[[Capture], float]) -> DegradationCurve:
        """Return how ``error(capture)`` grows with the noise; smaller is better."""
        errors = []
        for strength, capture in self:
            try:
                errors.append(float(error(capture)))
            except Exception as failure:
                failure.add_note(f"on the simulated capture at sensor noise strength {strength:g}")
                raise
        curve = DegradationCurve(self.strengths, tuple(errors))
        self.on_curve(getattr(error, "__name__", type(error).__name__), curve)
        return curve


def check_strengths(strengths: Iterable[float]) -> tuple[float, ...]:
    """Return the strengths, or raise a `DigsError` when they do not rise from 0 or above."""
    found = tuple(strengths) if isinstance(strengths, Iterable) else (strengths,)
    if not all(isinstance(each, int | float) and math.isfinite(each) for each in found):
        raise DigsError(f"strengths {shown(found)}: expected finite numbers")
    if not found or found[0] < 0 or not all(a < b for a, b in pairwise(found)):
        raise DigsError(f"strengths {shown(found)}: expected rising numbers, the first >= 0")
    return found


def _key(config: SimulateConfig) -> str:
    digest = hashlib.sha256(to_json(config).encode())
    for field in fields(config):
        value = getattr(config, field.name)
        if isinstance(value, Path) and value.is_file():
            digest.update(hashlib.sha256(value.read_bytes()).digest())
    return digest.hexdigest()[:KEY_LENGTH]


@cache
def _code_key() -> str:
    root = Path(__file__).parents[2]
    digest = hashlib.sha256(to_json(versions()).encode())
    for path in sorted(path for pattern in _SOURCES for path in root.glob(pattern)):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:KEY_LENGTH]
