"""The tiers as a whole: exactness without effects, range, labels, seeds."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.camera.profiles import PROFILES, load_profile
from digs_warp.sim.config import Tier
from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.effects import AFTER_MATCHING, EFFECTS
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.frame import Cause, FrameTruth, Motion, Sensed
from digs_warp.sim.sensor.law import sense_depth
from digs_warp.sim.sensor.tiers import apply_effects, depth_of, sense
from reference.stereo_frames import CountedRays, broadband, make_frame, make_rig

NAMES = [effect.name for effect in EFFECTS]
AFTER = [effect.name for effect in AFTER_MATCHING]


class StepRays(CountedRays):
    """The right eye does not see the strip left of the near square."""

    def right_visibility(
        self, where: np.ndarray | None = None, depth: np.ndarray | None = None
    ) -> np.ndarray:
        visible = super().right_visibility(where)
        visible[60:180, 70:110] = False
        return visible


def rich_frame(number: int = 0) -> FrameTruth:
    """A frame with something for every effect: a step, a plain and a white area."""
    rig = replace(load_profile("bare-matcher").rig(320, 240), min_depth=0.7)
    disparity = np.broadcast_to(20 + 0.02 * np.arange(240.0)[:, None], (240, 320)).copy()
    disparity[60:180, 110:230] = 60.0
    disparity[200:220] = 2.0 * np.arange(320.0)[None] * 0.25 + 10
    image = broadband((240, 320))
    image[60:180, 110:230] = 128
    image[:40, 250:] = 255
    truth = make_frame(disparity, rig, image, number, Motion((1.5, 0.0, 0.0), (0.0, 4.0, 0.0)))
    return replace(truth, rays=StepRays((240, 320)))


def after(truth: FrameTruth, *names: str, seed: int = 0) -> Sensed:
    """The truth after effects."""
    return apply_effects(Sensed.of(truth), truth.rig, names, seed, truth.number)


def choices(*names: str) -> tuple[Choice, ...]:
    return tuple(Choice(name, name in names, "", "", "") for name in NAMES)


def assert_same(first: Sensed, second: Sensed) -> None:
    for name in ("disparity", "cause", "confidence"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_the_truth_comes_back_bit_for_bit() -> None:
    truth = make_frame(np.random.default_rng(0).uniform(2.5, 249, (240, 320)))
    truth.depth[5, 5:9] = np.nan
    sensed = sense(truth, "truth", choices())
    np.testing.assert_array_equal(depth_of(sensed, truth), truth.depth)
    assert (sensed.cause == Cause.OK).all() and (sensed.confidence == 1).all()


@pytest.mark.parametrize("tier", ["law", "guided", "matcher"])
def test_strength_zero_is_the_truth_within_the_range_whatever_the_plan(tier: str) -> None:
    truth = rich_frame()
    expected = np.where(truth.depth < truth.rig.min_depth, np.float32(-np.inf), truth.depth)
    assert (expected < 0).any()
    sensed = sense(truth, tier, choices(*NAMES), strength=0.0)  # pyright: ignore[reportArgumentType]
    np.testing.assert_array_equal(depth_of(sensed, truth), expected)


@pytest.mark.parametrize("name", AFTER)
def test_no_effect_writes_to_the_truth_or_to_what_it_is_given(name: str) -> None:
    truth = rich_frame()
    before = {key: getattr(truth, key).copy() for key in ("depth", "disparity", "image", "gray")}
    given = Sensed.of(truth)
    apply_effects(given, truth.rig, [name])
    for key, value in before.items():
        np.testing.assert_array_equal(getattr(truth, key), value)
    assert_same(given, Sensed.of(truth))


@pytest.mark.parametrize("tier", ["guided", "matcher"])
def test_tiers_that_match_have_the_planned_effects_of_the_device(tier: str) -> None:
    truth = make_frame(50.0, make_rig(static_field=0.1))
    truth = replace(truth, right=np.roll(truth.image, -50, axis=1))
    plain, field = (
        sense(truth, tier, choices(*names)).disparity  # pyright: ignore[reportArgumentType]
        for names in ((), ("static-field",))
    )
    added = (field - plain)[np.isfinite(plain)]
    assert added.size > 0.7 * plain.size
    assert added.std() == pytest.approx(0.1, rel=0.2)


def test_holes_keep_their_first_label_and_have_no_confidence() -> None:
    holes = np.indices((240, 320))[1] // 80
    sensed = Sensed.of(make_frame(50.0)).with_holes(holes == 1, Cause.MIRROR)
    sensed = sensed.with_holes((holes == 1) | (holes == 2), Cause.EDGE)
    assert sensed.cause[0, ::80].tolist() == [Cause.OK, Cause.MIRROR, Cause.EDGE, Cause.OK]
    assert sensed.confidence[0, ::80].tolist() == [1, 0, 0, 1]


def test_law_tier_is_the_law() -> None:
    truth = make_frame(np.linspace(3, 240, 320)[None], make_rig(disparity_sigma=0.1), number=3)
    truth = replace(truth, rig=replace(truth.rig, min_depth=0.4, max_depth=5.0))
    sensed = sense(truth, "law", seed=5)
    expected = sense_depth(truth.depth, truth.rig, 5, 3)
    known = (expected >= 0.4) & (expected <= 5.0)
    np.testing.assert_allclose(depth_of(sensed, truth)[known], expected[known], rtol=1e-6)
    assert set(np.unique(sensed.cause[~known])) == {Cause.NEAR, Cause.FAR}
    assert (depth_of(sensed, truth)[sensed.cause == Cause.NEAR] == -np.inf).all()


@pytest.mark.parametrize("shape", [(1, 1), (40, 1), (1, 40), (3, 3)])
def test_every_effect_bears_tiny_images(shape: tuple[int, int]) -> None:
    height, width = shape
    rig = load_profile("bare-matcher").rig(width, height)
    truth = make_frame(2.0, rig, broadband(shape))
    sensed = sense(truth, "guided", choices(*NAMES))
    assert sensed.disparity.shape == shape


def test_unknown_tier_is_refused() -> None:
    with pytest.raises(DigsError, match="expected truth, law, guided, matcher"):
        sense(make_frame(50.0), "kinect")  # pyright: ignore[reportArgumentType]


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
