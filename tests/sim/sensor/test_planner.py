"""The planner: a pure function from facts and rig to choices that a reader can follow."""

from dataclasses import replace
from typing import Any

import pytest

from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.planner import plan
from reference.stereo_frames import make_rig

NAMES = [effect.name for effect in EFFECTS]

# A well lit, well textured, matt wall far away and a rig without faults: nothing to simulate.
QUIET = SceneFacts(
    frames=1,
    min_depth=9.0,
    max_depth=11.0,
    mirror_share=0.0,
    transparent_share=0.0,
    saturated_share=0.0,
    dark_share=0.0,
    color_cast=0.0,
    blurred_share=0.0,
    skewed_share=0.0,
    blur_px=0.1,
    skew_px=0.1,
)
FAULTLESS = make_rig(max_depth=1e6)


def effects_on(facts: SceneFacts, rig: Any = FAULTLESS, selection: Any = "auto") -> set[str]:
    return {choice.effect for choice in plan(facts, rig, selection) if choice.on}


@pytest.mark.parametrize(
    ("changes", "effect"),
    [({"mirror_share": 0.01}, "mirror"), ({"transparent_share": 0.01}, "transparency")],
)
def test_each_effect_is_switched_on_by_its_fact(changes: dict[str, float], effect: str) -> None:
    assert effects_on(replace(QUIET, **changes)) == {effect}
    slight = dict.fromkeys(changes, 0.0005)
    assert effects_on(replace(QUIET, **slight)) == set()


@pytest.mark.parametrize(
    ("changes", "effect"),
    [
        ({"disparity_step": 0.1}, "quantum"),
        ({"static_field": 0.1}, "static-field"),
    ],
)
def test_each_fault_of_the_rig_switches_on_its_effect(
    changes: dict[str, float], effect: str
) -> None:
    assert effects_on(QUIET, replace(FAULTLESS, **changes)) == {effect}


def test_selection_overrides_the_facts_and_says_so() -> None:
    assert effects_on(QUIET, selection="all") == set(NAMES)
    assert effects_on(QUIET, load_profile("zed2-720").rig(), "none") == set()
    assert effects_on(QUIET, selection="quantum, mirror") == {"quantum", "mirror"}
    assert effects_on(QUIET, selection=["quantum"]) == {"quantum"}
    choices = {choice.effect: choice for choice in plan(QUIET, FAULTLESS, "mirror")}
    assert choices["mirror"].reason.startswith("asked for")
    assert not choices["quantum"].reason.startswith("left out")  # it would have been off anyway
