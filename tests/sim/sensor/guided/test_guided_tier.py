"""The guided tier on frames: where it fails, what it says about itself, and that it repeats itself."""

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.sensor_plan import SensorPlan, check_effects, plan_for_facts
from digs_warp.sim.record.session import prepare_session
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.facts import measure_facts
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.tiers import sense


@pytest.fixture(scope="module")
def frame() -> tuple[FrameTruth, SensorPlan, tuple[np.ndarray, np.ndarray]]:
    """The built-in object in its room, the plan, and the images that would be recorded."""
    config = SimulateConfig(profile="bare-matcher", width=480, frames=7, seed=2, tier="guided")
    session = prepare_session(config, load_inputs(config))
    truth, _ = session.truth(3, Shutter())
    plan = plan_for_facts(measure_facts([truth], truth.rig), session.rig, config)
    return truth, plan, recorded_images(truth, plan.pixel_effects)


def test_the_plan_adds_second_surfaces_and_what_no_image_shows(
    frame: tuple[FrameTruth, SensorPlan, tuple[np.ndarray, np.ndarray]],
) -> None:
    truth, plan, recorded = frame
    assert {choice.effect for choice in plan.depth} == {effect.name for effect in EFFECTS}
    assert "static-field" in {c.effect for c in plan.depth if c.on}
    plain = sense(truth, "guided", recorded=recorded)
    full = sense(truth, "guided", plan.depth, recorded=recorded)
    added = (full.disparity - plain.disparity)[plain.known & full.known]
    assert 0.03 < np.median(np.abs(added)) < 0.2


def test_a_full_search_refuses_second_surfaces_by_name() -> None:
    with pytest.raises(DigsError, match=r"--effects mirror: the tier 'matcher' searches the full"):
        check_effects(SimulateConfig(tier="matcher", effects="mirror,static-field"))
    for effects in ("all", "none", "vignetting,static-field"):
        for tier in ("guided", "matcher"):
            check_effects(SimulateConfig(tier=tier, effects=effects))
