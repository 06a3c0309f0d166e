"""What an effect on depth is: a frozen value that decides whether a scene calls for it."""

from dataclasses import dataclass
from typing import ClassVar, Protocol

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


class SensorEffect(Protocol):
    """The part that all effects share. Its fields are its parameters."""

    name: ClassVar[str]
    """In kebab-case, as --effects takes it; also part of the seed of its random numbers."""

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """Return whether the scene calls for the effect, and why."""
        ...


class DepthEffect(SensorEffect, Protocol):
    """An effect on measured depth; it needs no scene, only the camera. Strength 0 has no effect at all."""

    def apply(
        self, sensed: Sensed, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Return the frame after the effect; ``rng`` is seeded by (seed, frame, effect)."""
        ...


# An effect that changes a smaller share of the pixels is left out.
LEAST_SHARE = 1e-3


def choose_by_share(
    effect: str, statistic: str, share: float, cost: float, *, on: str, off: str
) -> Choice:
    """Return the choice "on if it changes enough pixels".

    Args:
        effect: its name.
        statistic: name of the share, as in `SceneFacts`.
        share: of the pixels that it changes, 0 to 1; NaN: none.
        cost: see `Choice`.
        on: the reason if it is on.
        off: the reason if it is off.
    """
    enough = bool(share > LEAST_SHARE)
    return Choice(
        effect,
        enough,
        f"{statistic} = {share:.2%}",
        f"> {LEAST_SHARE:.1%}",
        on if enough else off,
        share,
        cost,
    )


def choose_above(
    effect: str,
    statistic: str,
    value: float,
    limit: float,
    unit: str,
    cost: float = 0.0,
    *,
    on: str,
    off: str,
) -> Choice:
    """Return the choice "on if ``value`` exceeds ``limit``" for an effect on every pixel.

    Args:
        effect: its name.
        statistic: name of the value, as in `SceneFacts` or `StereoRig`.
        value: of the statistic; NaN (nothing to measure) leaves the effect off.
        limit: the threshold.
        unit: of both, for example "px"; empty for shares.
        cost: see `Choice`.
        on: the reason if it is on.
        off: the reason if it is off.
    """
    above = bool(value > limit)
    unit = f" {unit}" if unit else ""
    return Choice(
        effect,
        above,
        f"{statistic} = {value:.3g}{unit}",
        f"> {limit:g}{unit}",
        on if above else off,
        float(above),
        cost,
    )
