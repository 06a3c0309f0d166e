"""Exposures of photographs before the training: a ring of them around a ball, of which each sees a side."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.first_exposures import log_factors, without_exposure
from digs_warp.init.seen_colors import look_up
from digs_warp.measure.color_gain import OFFSET, ColorGain
from reference.tiny_capture import ball, write_tiny_capture

VIEWS = 24
ANGLES = np.linspace(0, 2 * np.pi, VIEWS, endpoint=False)


def around(factors: np.ndarray, points: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Values of points on a ring in photographs with these log factors, and what is true of the points."""
    random = np.random.default_rng(0)
    places = random.uniform(0, 2 * np.pi, points)
    true = random.uniform(0.2, 0.5, points)
    values = np.exp(factors) * (true[:, None] + OFFSET) - OFFSET
    hidden = np.cos(places[:, None] - ANGLES) < np.cos(np.radians(60))
    return np.where(hidden, np.nan, values), true


@pytest.mark.parametrize("waves", [1, 2, 5])
def test_exposures_are_found_even_if_they_follow_the_angle(waves: int) -> None:
    factors = 0.2 * np.cos(waves * ANGLES)
    found = log_factors(around(factors)[0])
    np.testing.assert_allclose(found, factors - factors.mean(), atol=1e-6)


def test_highlights_and_what_hides_a_point_do_not_count() -> None:
    factors = 0.2 * np.cos(ANGLES)
    values, _ = around(factors, points=2000)
    spoiled = np.random.default_rng(1).random(values.shape) < 0.2
    values = np.where(spoiled & np.isfinite(values), 0.9, values)
    np.testing.assert_allclose(log_factors(values), factors, atol=0.02)


def test_photographs_that_share_no_point_have_no_factor() -> None:
    apart = np.where(np.eye(4, dtype=bool), 0.5, np.nan)
    np.testing.assert_array_equal(log_factors(apart), 0.0)
    np.testing.assert_array_equal(log_factors(np.full((5, 3), np.nan)), 0.0)
    black = np.zeros((5, 3))
    np.testing.assert_array_equal(log_factors(black), 0.0)


def adapting(folder: Path, stops: float) -> tuple[list[Frame], np.ndarray]:
    """Frames of a small capture whose exposure follows their number, and their log factors."""
    capture = write_tiny_capture(folder / "capture", frames=VIEWS)
    factors = stops * np.log(2.0) / 2.4 * np.cos(ANGLES)
    frames = []
    for frame, factor in zip(capture.frames, factors, strict=True):
        gain = ColorGain(np.full(3, factor))
        image = np.clip(gain.applied(0.6 * frame.load_image() / 255.0), 0.0, 1.0)
        frames.append(frame.with_layer(Layer.IMAGE, np.rint(255.0 * image).astype(np.uint8)))
    return frames, factors


def mean_colors(frames: list[Frame], points: PointCloud) -> tuple[np.ndarray, np.ndarray]:
    """Which points are seen, and their mean colors."""
    colors = look_up(frames, points.points_world).colors
    counts = np.isfinite(colors[..., 0]).sum(axis=1)
    return counts > 0, np.nansum(colors, axis=1) / np.maximum(counts, 1)[:, None]


def test_first_colors_are_those_of_one_exposure(tmp_path: Path) -> None:
    even, _ = adapting(tmp_path / "even", 0.0)
    uneven, _ = adapting(tmp_path / "uneven", 1.0)
    points = PointCloud(ball(2000).means, np.full((2000, 3), 0.3))
    seen, expected = mean_colors(even, points)
    found = without_exposure(points, uneven).colors
    assert np.abs(found - expected)[seen].mean() < 0.015
    np.testing.assert_array_equal(found[~seen], points.colors[~seen])
    # Taken as they are, the photographs give other colors.
    _, taken = mean_colors(uneven, points)
    assert np.abs(taken - expected)[seen].mean() > 0.03


def test_nothing_changes_where_the_exposure_is_constant_or_depth_is_missing(tmp_path: Path) -> None:
    even, _ = adapting(tmp_path / "even", 0.0)
    points = PointCloud(ball(500).means, np.full((500, 3), 0.3))
    assert without_exposure(points, even) is points
    uneven, _ = adapting(tmp_path / "uneven", 1.0)
    blind = [frame.without_layer(Layer.DEPTH) for frame in uneven]
    assert without_exposure(points, blind) is points
    none = replace(points, points_world=np.zeros((0, 3)), colors=np.zeros((0, 3)))
    assert without_exposure(none, uneven) is none
