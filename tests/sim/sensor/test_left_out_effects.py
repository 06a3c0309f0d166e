"""What the plan leaves out would have changed next to nothing: sample meshes kept aside, every effect."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.sim.camera.metering import meter_walk
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.frame_maker import FrameMaker, RenderedFrame
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.sensor_plan import SensorPlan, make_plan
from digs_warp.sim.record.session import Session, prepare_session
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.planner import override
from digs_warp.sim.sensor.tiers import sense
from digs_warp.study.scenes import OBJECT_SIZE
from studies.realism_scenes import places

pytestmark = pytest.mark.long

# Stated share of the pixels whose depth an effect on depth that is off would change.
STATED = 0.002

# An effect on the images moves matches by chance, too: at most this many times as many as other noise does.
OF_OTHER_NOISE = 2.0

ON_DEPTH = {effect.name for effect in EFFECTS}
NUMBER = 4  # between those that the plan looks at


def disparity(session: Session, plan: SensorPlan, frame: RenderedFrame, draw: int) -> np.ndarray:
    """What the default sensor measures under one draw of the noise [px]."""
    config, moment = session.config, session.moments[NUMBER]
    adapted = plan.adapted(moment)
    images = recorded_images(frame.truth, plan.pixel_effects, draw, 1.0, adapted)
    return sense(frame.truth, "guided", plan.depth, config.seed, recorded=images).disparity


def with_effect(plan: SensorPlan, name: str) -> SensorPlan:
    """The plan with one more effect on."""
    color, depth = (
        override(choices, {*plan.effects_on, name}) for choices in (plan.color, plan.depth)
    )
    return replace(plan, color=color, depth=depth)


def changed(first: np.ndarray, second: np.ndarray) -> float:
    """Share of the pixels that lost or gained a value, or moved by more than a pixel."""
    known, also = np.isfinite(first), np.isfinite(second)
    with np.errstate(invalid="ignore"):
        return float(np.mean((known != also) | (np.abs(first - second) > 1)))


def test_effects_that_are_off_would_change_next_to_nothing(sample_data: Path) -> None:
    tried = set()
    for place in (each for each in places(sample_data) if not each.tuned):
        config = SimulateConfig(
            profile="bare-matcher",
            mesh=place.mesh,
            environment=place.environment,
            object_size=OBJECT_SIZE,
            width=240,
            height=135,
            frames=9,
        )
        session = prepare_session(config, load_inputs(config))
        plan = make_plan(session)
        frame = FrameMaker(session, plan).render(NUMBER)
        metered = plan.adaptation or meter_walk(session)
        usual = disparity(session, plan, frame, 0)
        by_chance = changed(usual, disparity(session, plan, frame, 1))
        for choice in (*plan.color, *plan.depth):
            if choice.on:
                continue
            forced = with_effect(plan, choice.effect)
            forced = replace(forced, adaptation=metered)
            # Effects on depth do not change what is rendered.
            again = (
                frame if choice.effect in ON_DEPTH else FrameMaker(session, forced).render(NUMBER)
            )
            share = changed(usual, disparity(session, forced, again, 0))
            limit = STATED if choice.effect in ON_DEPTH else OF_OTHER_NOISE * by_chance
            assert share < limit, (place, choice.effect, by_chance)
            tried.add(choice.effect)
    assert {"mirror", "transparency", "auto-exposure"} <= tried
