"""Labels of failed matches against one claim after the other over the whole image."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.drift import NO_DRIFT, Drift
from digs_warp.sim.sensor.error_attribution import attribute_errors
from digs_warp.sim.sensor.frame import Cause, FrameTruth
from reference.blame_twin import blame_twin
from reference.stereo_frames import PLAIN, make_frame, make_rig

MATERIALS = (
    PLAIN,
    Material("gloss", np.ones(3), roughness=0.1),
    Material("glass", np.ones(3), transmission=1.0),
    Material("chrome", np.ones(3), metallic=1.0, roughness=0.0),
)
DRIFTS = {
    "none": NO_DRIFT,
    "turned": Drift(pitch_deg=0.1, yaw_deg=0.15, roll_deg=0.3, focal=0.002, baseline=0.01),
    "longer": Drift(baseline=0.05),
}


def messy_frame(width: int, height: int, window: int, seed: int = 0) -> FrameTruth:
    """A frame in which everything goes wrong somewhere: steps, gaps, dark, bright and weak texture."""
    rng = np.random.default_rng(seed)
    rig = make_rig(width, height, window=window, min_depth=0.7, max_depth=9.0, image_noise=3.0)
    blocks = (-(-height // 12), -(-width // 12))
    levels = rng.uniform(4, 80, blocks) * (rng.random(blocks) < 0.9)
    disparity = np.kron(levels, np.ones((12, 12)))[:height, :width]
    disparity += rng.uniform(0, 0.4, disparity.shape)
    light = np.kron(rng.choice([5, 100, 250], blocks), np.ones((12, 12)))[:height, :width]
    contrast = np.kron(rng.choice([0.3, 2, 20], blocks), np.ones((12, 12)))[:height, :width]
    gray = np.clip(light + contrast * rng.standard_normal(light.shape), 0, 255)
    image = np.repeat(gray.astype(np.uint8)[..., None], 3, axis=2)
    with np.errstate(divide="ignore"):
        truth = make_frame(disparity, rig, image)
    depth = np.where(rng.random(disparity.shape) < 0.02, np.nan, truth.depth).astype(np.float32)
    ids = np.kron(rng.integers(-1, 4, blocks), np.ones((12, 12), int))[:height, :width]
    return replace(truth, depth=depth, material_ids=ids.astype(np.int32), materials=MATERIALS)


def reported(truth: FrameTruth, seed: int = 1) -> np.ndarray:
    """Matches of which some are right, some shifted as by the drift, some wrong, some missing."""
    rng = np.random.default_rng(seed)
    kind = rng.integers(0, 4, truth.depth.shape)
    shown = truth.drift.reported_disparity(truth.shown_disparity)
    found = np.choose(kind, [truth.disparity, shown, truth.disparity + 3, np.float32(np.nan)])
    return found.astype(np.float32)


@pytest.mark.parametrize("drift", DRIFTS)
@pytest.mark.parametrize(
    ("width", "height", "window"), [(1, 1, 5), (2, 9, 3), (7, 2, 9), (150, 90, 5), (131, 77, 1)]
)
def test_labels_are_those_of_the_claims_one_by_one(
    width: int, height: int, window: int, drift: str
) -> None:
    truth = replace(messy_frame(width, height, window), drift=DRIFTS[drift])
    found = reported(truth)
    np.testing.assert_array_equal(attribute_errors(found, truth), blame_twin(found, truth))


def test_every_label_that_matching_can_have_occurs() -> None:
    truth = replace(messy_frame(150, 90, 5), drift=DRIFTS["turned"])
    labels = set(np.unique(attribute_errors(reported(truth), truth)).tolist())
    expected = {
        *(Cause.OK, Cause.BAND, Cause.OCCLUDED, Cause.WEAK_TEXTURE, Cause.SPECULAR, Cause.MIRROR),
        *(Cause.TRANSPARENT, Cause.EXPOSURE, Cause.NEAR, Cause.FAR, Cause.EDGE),
        *(Cause.RECTIFICATION, Cause.RANDOM),
    }
    assert expected <= labels


def test_rays_are_asked_only_where_their_answer_counts() -> None:
    truth = messy_frame(150, 90, 5)
    assert truth.rays.asked == []  # pyright: ignore[reportAttributeAccessIssue]
    attribute_errors(truth.disparity, truth)
    assert truth.rays.asked == []  # pyright: ignore[reportAttributeAccessIssue]
