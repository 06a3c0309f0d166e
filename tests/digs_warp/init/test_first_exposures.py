"""Exposures of photographs before the training: a ring of them around a ball, of which each sees a side."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.first_exposures import (
    FirstExposures,
    first_exposures,
    without_exposure,
)
from digs_warp.init.seen_colors import look_up
from digs_warp.measure.color_gain import (
    DARK,
    JOINT_ROUNDS,
    LEAST,
    OFFSET,
    SATURATED,
    SETTLED,
    USUAL,
    ColorGain,
    joint_log_factors,
)
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


def dense_log_factors(values: np.ndarray) -> np.ndarray:
    """The twin of `joint_log_factors`: all unknowns at once, points included, in one dense matrix."""
    points, photos = values.shape
    point, photo = np.nonzero(np.isfinite(values))
    light = values[point, photo] + OFFSET
    each = np.arange(len(light))
    rows = np.zeros((len(light), photos + points))
    rows[each, photo] = rows[each, photos + point] = 1.0
    weights, found = light**2, np.zeros(photos)
    for _ in range(JOINT_ROUNDS):
        before, scaled = found, np.sqrt(weights)
        solved = np.linalg.lstsq(scaled[:, None] * rows, scaled * np.log(light), rcond=1e-9)[0]
        found = solved[:photos] - solved[:photos].mean()
        if np.abs(found - before).max() < SETTLED:
            break
        misses = light * np.abs(np.log(light) - rows @ solved)
        allowed = max(USUAL * float(np.median(misses)), LEAST)
        weights = light**2 * (allowed / np.maximum(misses, allowed)) ** 2
    return found


def test_factors_are_those_of_all_unknowns_at_once() -> None:
    values = around(0.2 * np.cos(2 * ANGLES), points=150)[0]
    values *= np.random.default_rng(2).uniform(0.7, 1.3, values.shape)
    assert np.nanmax(values) < SATURATED / 255.0
    assert np.nanmin(values) > DARK
    np.testing.assert_allclose(joint_log_factors(values), dense_log_factors(values), atol=1e-9)


def toned(
    log_gains: np.ndarray, noise: float = 0.005, points: int = 600
) -> tuple[np.ndarray, np.ndarray]:
    """Colors of matte points in photographs of these gains (m,) or (m, 3), and the true colors."""
    random = np.random.default_rng(0)
    true = random.uniform(0.1, 0.55, (points, 3))
    seen_from = random.uniform(0, 2 * np.pi, points)[:, None] - ANGLES
    gains = np.exp(np.broadcast_to(log_gains.reshape(VIEWS, -1), (VIEWS, 3)))
    colors = gains * (true[:, None] + OFFSET) - OFFSET
    colors = np.clip(colors + noise * random.normal(size=colors.shape), 0.0, 1.0)
    return np.where(np.cos(seen_from)[..., None] < 0.3, np.nan, colors), true


def glossy(points: int = 600) -> np.ndarray:
    """Colors in constant exposure: points are up to 0.2 lighter from where they reflect a bluish sky.

    The sky stands on one side, so that all points together are lighter from there.
    """
    colors, _ = toned(np.zeros(VIEWS))
    random = np.random.default_rng(1)
    turned = random.normal(0, 1.0, (points, 1))
    sheen = np.maximum(np.cos(ANGLES - turned), 0.0) * random.uniform(0, 0.2, (points, 1))
    return np.clip(colors + sheen[..., None] * [0.6, 0.8, 1.0], 0.0, 1.0)


def test_gloss_is_no_exposure() -> None:
    colors = glossy()
    gain = 3.46 * np.sqrt(np.mean(joint_log_factors(colors[..., 2]) ** 2))
    assert gain > 0.1  # stops that are found, but explain little
    found = FirstExposures.of(colors)
    assert not found.vary
    np.testing.assert_array_equal(found.log_factors, 0.0)
    # Exposures of a shiny object are found.
    logs = 0.2 * np.cos(ANGLES)
    adapted = np.exp(logs)[:, None] * (colors + OFFSET) - OFFSET
    shiny = FirstExposures.of(adapted)
    assert shiny.vary and np.corrcoef(shiny.log_factors, logs)[0, 1] > 0.95


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


def in_one_exposure(points: PointCloud, frames: list[Frame]) -> PointCloud:
    found = first_exposures(points, frames)
    assert found is not None
    return without_exposure(points, frames, found)


def test_first_colors_are_those_of_one_exposure(tmp_path: Path) -> None:
    even, _ = adapting(tmp_path / "even", 0.0)
    uneven, _ = adapting(tmp_path / "uneven", 1.0)
    points = PointCloud(ball(2000).means, np.full((2000, 3), 0.3))
    seen, expected = mean_colors(even, points)
    found = in_one_exposure(points, uneven).colors
    assert np.abs(found - expected)[seen].mean() < 0.015
    np.testing.assert_array_equal(found[~seen], points.colors[~seen])
    # Taken as they are, the photographs give other colors.
    _, taken = mean_colors(uneven, points)
    assert np.abs(taken - expected)[seen].mean() > 0.03


def test_nothing_changes_where_the_exposure_is_constant_or_depth_is_missing(tmp_path: Path) -> None:
    even, _ = adapting(tmp_path / "even", 0.0)
    points = PointCloud(ball(500).means, np.full((500, 3), 0.3))
    assert in_one_exposure(points, even) is points
    uneven, _ = adapting(tmp_path / "uneven", 1.0)
    blind = [frame.without_layer(Layer.DEPTH) for frame in uneven]
    assert first_exposures(points, blind) is None
    none = replace(points, points_world=np.zeros((0, 3)), colors=np.zeros((0, 3)))
    assert first_exposures(none, uneven) is None
