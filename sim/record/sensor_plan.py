"""The plan of a recording: the effects on depth and on the images, and why they are on or off."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.viewpoints import spread
from digs_warp.sim.camera.metering import meter_walk
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.session import Session
from digs_warp.sim.sensor.color import (
    AUTO_EXPOSURE,
    CALIBRATION_DRIFT,
    COLOR_EFFECTS,
    IMAGE_BLUR,
    PIXEL_EFFECTS,
    PROJECTOR,
    ROLLING_SHUTTER,
    WHITE_BALANCE,
)
from digs_warp.sim.sensor.color.adaptation import NOT_ADAPTED, Adaptation, AdaptationTrack
from digs_warp.sim.sensor.color.protocol import PixelEffect
from digs_warp.sim.sensor.drift import NO_DRIFT, Drift
from digs_warp.sim.sensor.effects import AFTER_MATCHING, EFFECTS
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.facts import SceneFacts, measure_facts
from digs_warp.sim.sensor.planner import EFFECT_NAMES, override, plan, wanted_effects

# Frames that the plan looks at, evenly spaced: four on each of three orbits.
LOOKS = 12

# Effects that act on depth in the tiers that plan effects. A full search finds second surfaces by itself.
_DEPTH_EFFECTS = {
    "guided": frozenset(EFFECT_NAMES),
    "matcher": frozenset(effect.name for effect in AFTER_MATCHING),
}

# Effects on the photographs, then those on depth.
ALL_EFFECT_NAMES = tuple(effect.name for effect in (*COLOR_EFFECTS, *EFFECTS))


@dataclass(frozen=True)
class SensorPlan:
    """The choices for a recording.

    Attributes:
        depth: effects on the depth path, in the order in which they act; empty where the tier plans none.
        color: the same on the color path.
        facts: the basis of the choices; None where the tier plans nothing.
        adaptation: how exposure and white balance follow the light; None where both are off.
    """

    depth: tuple[Choice, ...] = ()
    color: tuple[Choice, ...] = ()
    facts: SceneFacts | None = None
    adaptation: AdaptationTrack | None = None

    @property
    def effects_on(self) -> tuple[str, ...]:
        """Names of all effects that are on."""
        choices = (*self.color, *self.depth)
        return tuple(choice.effect for choice in choices if choice.on)

    @property
    def pixel_effects(self) -> tuple[PixelEffect, ...]:
        """Effects for the finished images, in the order in which they act."""
        return tuple(effect for effect in PIXEL_EFFECTS if self._has_color(effect.name))

    @property
    def projects(self) -> bool:
        """Whether the dots of the projector show."""
        return self._has_color(PROJECTOR.name)

    def adapted(self, moment: float) -> Adaptation:
        """Return what exposure and white balance are set to at a time [s], at strength 1."""
        if self.adaptation is None:
            return NOT_ADAPTED
        now = self.adaptation.at(moment)
        exposing, balancing = map(self._has_color, (AUTO_EXPOSURE.name, WHITE_BALANCE.name))
        return Adaptation(
            now.exposure if exposing else 0.0,
            now.red if balancing else 0.0,
            now.blue if balancing else 0.0,
        )

    def color_gain(self, moment: float, strength: float) -> tuple[float, float, float] | None:
        """Return the factors of exposure and white balance on red, green and blue; None: both are off."""
        if self.adaptation is None:
            return None
        return self.adapted(moment).scaled(strength).color_gain

    def shutter(
        self, rig: StereoRig, strength: float = 1.0, adapted: Adaptation = NOT_ADAPTED
    ) -> Shutter:
        """Return the shutter of both eyes; ``strength`` stretches its times, a longer exposure its blur."""
        rolling, blurring = map(self._has_color, (ROLLING_SHUTTER.name, IMAGE_BLUR.name))
        if self.facts is None or strength == 0:
            return Shutter()
        longer = adapted.scaled(strength).longer_exposure(rig)
        return Shutter(
            bands=ROLLING_SHUTTER.bands(self.facts, rig, strength) if rolling else 1,
            views=IMAGE_BLUR.views(self.facts, strength * longer) if blurring else 1,
            readout_time=strength * rig.readout_time if rolling else 0.0,
            exposure_time=strength * longer * rig.exposure_time if blurring else 0.0,
        )

    def drift(self, rig: StereoRig, seed: int, strength: float = 1.0) -> Drift:
        """Return how the calibration of the recording has drifted; see `CalibrationDrift.draw`."""
        if not self._has_color(CALIBRATION_DRIFT.name) or strength == 0:
            return NO_DRIFT
        return CALIBRATION_DRIFT.draw(rig, seed, strength)

    def as_json(self, drift: Drift = NO_DRIFT) -> dict[str, Any]:
        """Return the plan as sensor_plan.json holds it, with the drift of the recording."""
        facts = {} if self.facts is None else asdict(self.facts)
        return {
            "depth": [asdict(choice) for choice in self.depth],
            "color": [asdict(choice) for choice in self.color],
            "drift": asdict(drift),
            # Depth has no extremes if nothing is in view.
            "facts": {name: v if np.isfinite(v) else None for name, v in facts.items()},
        }

    def _has_color(self, name: str) -> bool:
        return any(choice.effect == name and choice.on for choice in self.color)


def make_plan(session: Session) -> SensorPlan:
    """Look at a few frames and choose the effects; tiers without effects get an empty plan."""
    config = session.config
    if not config.plans_effects:
        return SensorPlan()
    check_effects(config)
    made = plan_for_facts(look_around(session), session.rig, config)
    if not {AUTO_EXPOSURE.name, WHITE_BALANCE.name} & set(made.effects_on):
        return made
    return replace(made, adaptation=meter_walk(session))


def look_around(session: Session) -> SceneFacts:
    """Return the facts of a recording, from a few small frames of it."""
    config = session.config
    numbers = spread(config.frame_count, LOOKS)
    small = session.small()
    # The facts are those of the left eye.
    looks = [small.truth(number, Shutter(), both_eyes=False)[0] for number in numbers]
    return measure_facts(looks, session.rig)


def plan_for_facts(facts: SceneFacts, rig: StereoRig, config: SimulateConfig) -> SensorPlan:
    """Return the plan for a scene that has been measured."""
    wanted = wanted_effects(config.effects, ALL_EFFECT_NAMES)
    color = tuple(effect.choose(facts, rig) for effect in COLOR_EFFECTS)
    acting = _DEPTH_EFFECTS[config.tier]
    depth = tuple(choice for choice in plan(facts, rig) if choice.effect in acting)
    if wanted is not None:
        color, depth = override(color, wanted), override(depth, wanted)
    return SensorPlan(depth, color, facts)


def check_effects(config: SimulateConfig) -> None:
    """Raise a `DigsError` if the settings name an effect that does not exist, or not in their tier."""
    wanted = wanted_effects(config.effects, ALL_EFFECT_NAMES)
    if wanted is None or config.effects in ("all", "none"):
        return
    idle = wanted & frozenset(EFFECT_NAMES) - _DEPTH_EFFECTS[config.tier]
    if idle:
        raise DigsError(
            f"--effects {', '.join(sorted(idle))}: the tier '{config.tier}' searches the full range and "
            "finds such surfaces by itself; leave them out, or choose --tier guided"
        )
