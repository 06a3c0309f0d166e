"""One simulated walk at rising sensor noise."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.session import Session, load_inputs, prepare_session
from digs_warp.sim.testing.cache import CaptureCache
from digs_warp.sim.testing.curve import DegradationCurve


@dataclass(frozen=True)
class NoiseSeries:
    """Captures of the same walk round the same object; only the sensor's errors differ.

    Iterating gives (strength, capture), strengths rising; captures are simulated when first asked for.

    Attributes:
        config: of the recording at strength 1.
        strengths: factors on the sensor's errors; 0: perfect depth, 1: as the real sensor.
        cache: where the captures are kept.
    """

    config: SimulateConfig
    strengths: tuple[float, ...]
    cache: CaptureCache

    def __post_init__(self) -> None:
        rising = all(a < b for a, b in pairwise(self.strengths))
        if not self.strengths or not rising or self.strengths[0] < 0:
            raise DigsError(f"strengths {self.strengths}: expected rising numbers, the first >= 0")

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
        """Return how ``error(capture)`` grows with the noise; less is better."""
        errors = []
        for strength, capture in self:
            try:
                errors.append(float(error(capture)))
            except Exception as failure:
                failure.add_note(f"on the simulated capture at sensor noise strength {strength:g}")
                raise
        return DegradationCurve(self.strengths, tuple(errors))
