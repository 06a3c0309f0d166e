"""The range of the camera is a hard limit: no tier, effect or strength reports a depth outside it."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.sim.camera.profiles import PROFILES, load_profile
from digs_warp.sim.config import Tier
from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.frame import Cause, FrameTruth, Motion
from digs_warp.sim.sensor.tiers import depth_of, sense
from reference.stereo_frames import broadband, make_frame

NAMES = [effect.name for effect in EFFECTS]


def wide_frame(profile: str) -> FrameTruth:
    """Depths from half the nearest to twice the farthest, a mirror and glass, all effects possible."""
    rig = load_profile(profile).rig(160, 120)
    depth = np.geomspace(0.5 * rig.min_depth, 2 * rig.max_depth, 160)[None].repeat(120, 0)
    truth = make_frame(
        rig.focal_baseline / depth, rig, broadband((120, 160)), 0, Motion((1, 0, 0), (0, 2, 0))
    )
    materials = (
        *truth.materials,
        Material("mirror", np.ones(3), metallic=1.0, roughness=0.0),
        Material("glass", np.ones(3), roughness=0.0, transmission=0.9),
    )
    ids = np.indices((120, 160))[0] // 40
    right = np.roll(truth.image, -10, axis=1)  # something to match
    return replace(truth, materials=materials, material_ids=ids, right=right)


def assert_in_range(truth: FrameTruth, tier: Tier, names: list[str], strength: float) -> None:
    plan = tuple(Choice(name, name in names, "", "", "") for name in NAMES)
    sensed = sense(truth, tier, plan, strength=strength)
    depth = depth_of(sensed, truth)
    known = depth[np.isfinite(depth)]
    assert known.size
    rig = truth.rig
    assert np.float32(rig.min_depth) <= known.min() and known.max() <= rig.max_depth
    lost = ~np.isfinite(depth)
    assert (sensed.cause[lost] != Cause.OK).all(), "every lost pixel has a cause"
    assert (sensed.confidence[lost] == 0).all()
    assert (sensed.cause[depth == np.inf] == Cause.FAR).all()
    assert (sensed.cause[depth == -np.inf] == Cause.NEAR).all()


@pytest.mark.parametrize("profile", sorted(PROFILES))
def test_every_tier_of_every_camera_stays_in_range(profile: str) -> None:
    truth = wide_frame(profile)
    for strength in (0.0, 1.0, 2.0, 4.0):
        for tier in ("truth", "law", "guided", "matcher"):
            assert_in_range(truth, tier, NAMES, strength)


def test_a_depth_at_the_end_of_the_range_is_in_range_however_it_is_rounded() -> None:
    rig = load_profile("zed2-720").rig(160, 120)
    exact = make_frame(rig.focal_baseline / np.float64(rig.max_depth), rig)
    beyond = replace(exact, depth=1.001 * exact.depth)
    assert (depth_of(sense(exact, "truth"), exact) == np.float32(rig.max_depth)).all()
    assert (depth_of(sense(beyond, "truth"), beyond) == np.inf).all()
