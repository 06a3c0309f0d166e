"""What is learned from simulated scenes: features, overlaps, and the choice of a matcher's parameters."""

import numpy as np
import pytest

from digs_warp.study.transfer.matching import CANDIDATES, KnownPair, MatcherSettings, wrong_share
from digs_warp.study.transfer.segmentation import (
    PAIRS,
    RINGS,
    DepthFrame,
    above_plane,
    describe,
    find_object,
    overlap,
    train,
)

FOCAL = 200.0
SIZE = (90, 120)
BOX = (slice(35, 60), slice(50, 80))
HIGH = 0.04


def slanted_plane(tilt: float) -> np.ndarray:
    """Return the planar depth of a plane .6 m away, tilted about the x axis [rad]; (height, width)."""
    rows = (np.arange(SIZE[0]) - SIZE[0] / 2) / FOCAL
    depth = 0.6 / (1 - np.tan(tilt) * rows)
    return np.repeat(depth[:, None], SIZE[1], axis=1)


def box_on_plane(tilt: float = 0.0, noise: float = 0.0, seed: int = 0) -> DepthFrame:
    """Return a plane with a raised patch."""
    depth = slanted_plane(tilt)
    is_object = np.zeros(SIZE, dtype=bool)
    is_object[BOX] = True
    depth = np.where(is_object, depth - HIGH, depth)
    depth += noise * np.random.default_rng(seed).standard_normal(SIZE)
    return DepthFrame(depth.astype(np.float32), FOCAL, is_object)


@pytest.mark.parametrize("tilt", [0.0, 0.4, -0.9])
def test_a_pixel_of_a_plane_stands_out_of_nothing(tilt: float) -> None:
    # Neighbors are whole pixels, opposite ones the same number away: what is left is float32's.
    frame = DepthFrame(slanted_plane(tilt).astype(np.float32), FOCAL, np.zeros(SIZE, bool))
    rows, columns = (grid.ravel() for grid in np.mgrid[40:50, 50:60])
    features = describe(frame, rows, columns)
    assert features.shape == (100, len(RINGS) * PAIRS)
    assert np.nanmax(np.abs(features)) < 1e-5


def test_a_raised_patch_stands_out_by_its_height() -> None:
    frame = box_on_plane()
    features = describe(frame, np.array([47]), np.array([65])).reshape(len(RINGS), PAIRS)
    wide = features[RINGS.index(0.08)]
    inverse = 1 / (0.6 - HIGH)
    expected = (inverse - 1 / 0.6) / inverse**2
    np.testing.assert_allclose(wide, expected, rtol=1e-4)
    assert np.nanmax(np.abs(features[RINGS.index(0.01)])) < 1e-6


def test_neighbors_without_depth_and_outside_are_unknown() -> None:
    frame = box_on_plane()
    frame.depth[47, 66:] = np.nan
    features = describe(frame, np.array([47, 0]), np.array([65, 0])).reshape(2, len(RINGS), PAIRS)
    assert np.isnan(features[0, 1]).sum() == 1  # the level pair alone
    assert np.isnan(features[1]).all()
    frame.depth[:] = np.nan
    assert np.isnan(describe(frame, np.array([5]), np.array([5]))).all()


def test_trees_find_the_patch_on_planes_that_they_have_not_seen() -> None:
    learned = [box_on_plane(tilt, 0.001, seed) for seed, tilt in enumerate((0.0, 0.3, 0.6))]
    trees = train(learned)
    found = find_object(trees, box_on_plane(-0.5, 0.001, 7))
    assert overlap(found, box_on_plane().is_object) > 0.85
    empty = DepthFrame(np.full(SIZE, np.nan, np.float32), FOCAL, np.zeros(SIZE, bool))
    assert not find_object(trees, empty).any()


def test_the_plane_alone_finds_the_patch() -> None:
    frame = box_on_plane(0.4, 0.001)
    assert overlap(above_plane(frame, 0.02), frame.is_object) > 0.95


def test_overlap_counts_pixels() -> None:
    a, b = np.zeros(10, bool), np.zeros(10, bool)
    assert overlap(a, b) == 1.0
    a[:4], b[2:6] = True, True
    assert overlap(a, b) == pytest.approx(2 / 6)


def test_the_matcher_is_judged_by_wrong_and_open_pixels() -> None:
    rng = np.random.default_rng(0)
    right = rng.integers(0, 256, (60, 120), dtype=np.uint8)
    left = np.roll(right, 6, axis=1)
    truth = np.full((60, 120), 6.0)
    truth[:, :6] = np.nan
    pair = KnownPair(left, right, truth, 16)
    usual = wrong_share(MatcherSettings(), pair)
    # The first 16 columns cannot be searched in full: OpenCV leaves them open.
    assert usual == pytest.approx(10 / 114, abs=0.02)
    moved = KnownPair(left, right, truth + 1.5, 16)
    assert wrong_share(MatcherSettings(), moved) == 1.0
    assert MatcherSettings() in CANDIDATES
