"""Colors that photographs show: their exposures before the training, and the degree that they call for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.sh import sh_basis
from digs_warp.init.first_exposures import FirstExposures, first_exposures, without_exposure
from digs_warp.init.seen_colors import SeenColors, look_up
from digs_warp.init.view_dependence import POINTS, chosen, prediction_error, view_dependence
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
from reference.tiny_capture import RADIUS, ball, write_tiny_capture

VIEWS = 24
ANGLES = np.linspace(0, 2 * np.pi, VIEWS, endpoint=False)


def around(factors: np.ndarray, points: int) -> np.ndarray:
    """Values of points on a ring in photographs with these log factors."""
    random = np.random.default_rng(0)
    places = random.uniform(0, 2 * np.pi, points)
    true = random.uniform(0.2, 0.5, points)
    values = np.exp(factors) * (true[:, None] + OFFSET) - OFFSET
    hidden = np.cos(places[:, None] - ANGLES) < np.cos(np.radians(60))
    return np.where(hidden, np.nan, values)


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
    values = around(0.2 * np.cos(2 * ANGLES), points=150)
    values *= np.random.default_rng(2).uniform(0.7, 1.3, values.shape)
    assert np.nanmax(values) < SATURATED / 255.0
    assert np.nanmin(values) > DARK
    np.testing.assert_allclose(joint_log_factors(values), dense_log_factors(values), atol=1e-9)


def glossy(points: int = 600) -> np.ndarray:
    """Colors in constant exposure: points are up to 0.2 lighter from where they reflect a bluish sky.

    The sky stands on one side, so that all points together are lighter from there.
    """
    random = np.random.default_rng(0)
    true = random.uniform(0.1, 0.55, (points, 1, 3))
    seen_from = random.uniform(0, 2 * np.pi, points)[:, None] - ANGLES
    colors = true + 0.005 * random.normal(size=(points, VIEWS, 3))
    colors[np.cos(seen_from) < 0.3] = np.nan
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
    # Points of matched photographs hide what is behind them, as depth tells.
    covering = PointCloud(ball(4000).means, np.full((4000, 3), 0.3), agreement=np.ones(4000))
    told, measured = (first_exposures(covering, each) for each in (blind, uneven))
    assert told is not None and measured is not None and told.vary
    np.testing.assert_allclose(told.log_factors, measured.log_factors, atol=0.03)
    none = replace(points, points_world=np.zeros((0, 3)), colors=np.zeros((0, 3)))
    assert first_exposures(none, uneven) is None


RNG = np.random.default_rng(0)


def walk(count: int = 52) -> np.ndarray:
    """Directions to cameras on three rings, (count, 3)."""
    angle = np.linspace(0, 6 * np.pi, count, endpoint=False)
    height = np.repeat([0.2, 0.5, 0.8], -(-count // 3))[:count]
    across = np.sqrt(1 - height**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=-1)


def seen(degree: int, points: int = 60, noise: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """Directions and colors of points whose color has this degree, each seen by half of the cameras."""
    directions = np.broadcast_to(-walk(), (points, 52, 3))
    sh = RNG.normal(size=(points, (degree + 1) ** 2, 3)) * 0.15
    colors = 0.5 + np.einsum("nmk,nkc->nmc", sh_basis(directions, degree), sh)
    colors = colors + RNG.normal(size=colors.shape) * noise
    normal = RNG.normal(size=(points, 3))
    away = np.einsum("nmc,nc->nm", directions, normal) > 0
    return directions, np.where(away[..., None], np.nan, colors)


@pytest.mark.parametrize(("shown", "used"), [(1, 1), (2, 3)])
def test_color_beyond_the_usual_degree_is_found(shown: int, used: int) -> None:
    found = chosen(*seen(shown))
    assert found.degree == used
    assert found.points == 60 and len(found.errors) == 4


def test_noise_is_no_dependence_on_the_view() -> None:
    matte = chosen(*seen(0, noise=0.1))
    assert matte.degree == 1
    assert matte.errors[3] < matte.errors[0]  # it predicts worse
    assert "used from 0.8 dB on" in matte.because


def off_the_surface(points: int = 12000, off: float = 0.01) -> SeenColors:
    """A matte ball, of which a half has texture, and points beside its surface by about ``off``.

    Each camera sees such a point where its ray meets the ball.
    """
    random = np.random.default_rng(0)
    normals = random.normal(size=(points, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    places = RADIUS * normals + off * random.normal(size=(points, 1)) * normals
    eyes = 5 * RADIUS * walk(24)
    rays = places[:, None] - eyes
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    along = -(rays * eyes).sum(axis=2)
    deep = along**2 - (eyes**2).sum(axis=1) + RADIUS**2
    met = eyes + (along - np.sqrt(np.maximum(deep, 0)))[..., None] * rays
    stripes = np.sin(met * 2 * np.pi / (0.3 * RADIUS)) * (met[..., :1] > 0)
    facing = (normals[:, None] * -rays).sum(axis=2) > 0.3
    seen_there = facing & (deep > 0)
    return SeenColors(places, eyes, np.where(seen_there[..., None], 0.5 + 0.3 * stripes, np.nan))


def test_texture_seen_by_points_off_the_surface_is_no_gloss() -> None:
    matte = off_the_surface()
    often = np.flatnonzero(np.isfinite(matte.colors[..., 0]).sum(axis=1) >= 8)
    anywhere = often[:: len(often) // POINTS]
    directions = matte.points_world[:, None] - matte.centers_world
    assert chosen(directions[anywhere], matte.colors[anywhere]).degree == 3
    assert view_dependence(matte).degree == 1
    # Gloss is found in plain surroundings, too.
    highlight = np.exp(-20 * (1 - directions[..., 2] / -np.linalg.norm(directions, axis=2)))
    shiny = SeenColors(
        matte.points_world, matte.centers_world, matte.colors + 0.4 * highlight[..., None]
    )
    assert view_dependence(shiny).degree == 3


def test_predictions_are_those_of_fits_without_the_color() -> None:
    directions, colors = seen(1, points=1)
    basis = sh_basis(directions, 1)
    some = np.flatnonzero(np.isfinite(colors[0, :, 0]))
    rows, values = basis[0, some], colors[0, some]
    ridge = 0.3 * np.diag([0.0, 1.0, 1.0, 1.0])
    errors = []
    for left_out in range(len(some)):
        others = np.arange(len(some)) != left_out
        normal = rows[others].T @ rows[others] + ridge
        fit = np.linalg.solve(normal, rows[others].T @ values[others])
        errors.append(values[left_out] - rows[left_out] @ fit)
    assert prediction_error(basis, colors) == pytest.approx(np.mean(np.square(errors)), rel=1e-6)


def test_points_that_few_views_see_decide_nothing(tmp_path: Path) -> None:
    capture = write_tiny_capture(tmp_path / "capture", frames=4)
    for frames, points in ((capture.frames, ball(50).means), (capture.frames[:1], ball(50).means)):
        found = view_dependence(look_up(frames, points))
        assert found.degree == 1 and found.errors == ()
        assert "too few points" in found.because
    away = np.full((5, 3), 10 * RADIUS)
    assert view_dependence(look_up(capture.frames, away)).degree == 1
