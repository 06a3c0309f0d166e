"""The degree of the color that photographs call for: shiny surfaces, matte ones, noise and too few views."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.geometry.sh import sh_basis
from digs_warp.init.seen_colors import SeenColors, look_up
from digs_warp.init.view_dependence import (
    POINTS,
    chosen,
    prediction_error,
    view_dependence,
)
from reference.tiny_capture import RADIUS, ball, write_tiny_capture

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
