"""What an effect is: a rule that decides whether a scene calls for it, and what it changes."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import Sensed


@dataclass(frozen=True)
class Choice:
    """The planner's decision on one effect.

    Attributes:
        effect: its name.
        on: whether it is simulated.
        statistic: what was measured, for example "transparent_share = 0.034".
        threshold: the rule, for example "> 0.001".
        reason: a sentence for the user.
        share: of the pixels that it changes, 0 to 1.
        cost: processor time that it takes, or would take [ms per megapixel of a frame].
    """

    effect: str
    on: bool
    statistic: str
    threshold: str
    reason: str
    share: float = 0.0
    cost: float = 0.0


# An effect that changes a smaller share of the pixels is left out.
LEAST_SHARE = 1e-3


class Effect:
    """An effect that is on where a quantity of rig and scene exceeds a limit.

    Attributes:
        name: in kebab-case, as --effects takes it; also part of the seed of its random numbers.
        statistic: name of the quantity, as in `StereoRig` or `SceneFacts`.
        limit: of the quantity.
        unit: of both, for example "px"; empty for shares.
        of_pixels: the quantity is the share of the pixels that the effect changes; others change all.
        cost: processor time that it takes, or would take [ms per megapixel of a frame].
        on, off: the reason if it is on or off.
    """

    name: ClassVar[str]
    statistic: ClassVar[str]
    limit: ClassVar[float] = 0.0
    unit: ClassVar[str] = ""
    of_pixels: ClassVar[bool] = False
    cost: ClassVar[float] = 0.0
    on: ClassVar[str]
    off: ClassVar[str]

    def measured(self, facts: SceneFacts, rig: StereoRig) -> float:
        """Return the quantity; NaN (nothing to measure) leaves the effect off."""
        return getattr(facts if hasattr(facts, self.statistic) else rig, self.statistic)

    def price(self, facts: SceneFacts, rig: StereoRig) -> float:
        """Return the cost on this scene."""
        return self.cost

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """Return whether the scene calls for the effect, and why."""
        value, limit, unit = self.measured(facts, rig), self.limit, f" {self.unit}".rstrip()
        if self.of_pixels:
            limit = LEAST_SHARE
        is_on = bool(value > limit)
        return Choice(
            self.name,
            is_on,
            f"{self.statistic} = {f'{value:.2%}' if self.of_pixels else f'{value:.3g}{unit}'}",
            f"> {f'{limit:.1%}' if self.of_pixels else f'{limit:g}{unit}'}",
            self.on if is_on else self.off,
            value if self.of_pixels else float(is_on),
            self.price(facts, rig),
        )


class DepthEffect(Effect):
    """An effect on measured depth; it needs no scene, only the camera. Strength 0 has no effect at all."""

    def apply(
        self, sensed: Sensed, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Return the frame after the effect; ``rng`` is seeded by (seed, frame, effect)."""
        raise NotImplementedError
