"""The planner: a pure function from facts and rig to choices that a reader can follow."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.facts import SceneFacts, measure_facts
from digs_warp.sim.sensor.planner import plan
from reference.stereo_frames import make_frame, make_rig

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


def facts_of(disparity: float) -> SceneFacts:
    """Facts of a plane."""
    return measure_facts([make_frame(disparity)], FAULTLESS)


def effects_on(facts: SceneFacts, rig: Any = FAULTLESS, selection: Any = "auto") -> set[str]:
    return {choice.effect for choice in plan(facts, rig, selection) if choice.on}


def test_a_quiet_scene_and_a_faultless_rig_need_no_effect() -> None:
    assert effects_on(QUIET) == set()


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


def test_every_choice_names_statistic_threshold_and_reason() -> None:
    rigs = [load_profile(name).rig() for name in ("zed2-720", "d435")]
    facts = [QUIET, facts_of(np.nan), facts_of(60.0)]
    for choice in (c for rig in rigs for f in facts for c in plan(f, rig)):
        assert choice.statistic and choice.threshold and len(choice.reason.split()) >= 4


def test_selection_overrides_the_facts_and_says_so() -> None:
    assert effects_on(QUIET, selection="all") == set(NAMES)
    assert effects_on(QUIET, load_profile("zed2-720").rig(), "none") == set()
    assert effects_on(QUIET, selection="quantum, mirror") == {"quantum", "mirror"}
    assert effects_on(QUIET, selection=["quantum"]) == {"quantum"}
    choices = {choice.effect: choice for choice in plan(QUIET, FAULTLESS, "mirror")}
    assert choices["mirror"].reason.startswith("asked for")
    assert not choices["quantum"].reason.startswith("left out")  # it would have been off anyway


def test_an_unknown_effect_is_refused_with_the_known_ones() -> None:
    with pytest.raises(DigsError, match=r"no effect 'kraken'.*quantum"):
        plan(QUIET, FAULTLESS, "quantum,kraken")
