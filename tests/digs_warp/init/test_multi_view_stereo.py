"""Depth from photographs: the sweep against its float64 twin, and what views must agree on."""

import logging
from typing import Any

import cv2
import numpy as np
import pytest
import warp as wp
from scipy.ndimage import map_coordinates

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.init import multi_view_stereo
from digs_warp.init.config import InitConfig
from digs_warp.init.depth_points import GUESSED_SHARE
from digs_warp.init.multi_view_stereo import matched_depth
from digs_warp.init.plane_sweep import (
    NO_SCORE,
    NOISE,
    SCORE_RADIUS,
    TILE_HEIGHT,
    TILE_WIDTH,
    WINDOW_RADIUS,
    SweptPair,
    SweptView,
)
from digs_warp.init.recipes import LEAST_MATCHED, initialize


def means(values: np.ndarray, radius: int) -> np.ndarray:
    """Return the mean of the square around each pixel that has a whole one, (h - 2 r, w - 2 r)."""
    size = 2 * radius + 1
    windows = np.lib.stride_tricks.sliding_window_view(values, (size, size))
    return windows.mean(axis=(2, 3))


def sweep_twin(
    reference: np.ndarray,
    others: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
    starts: np.ndarray,
    step: float,
    count: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return best inverse depths, their scores, and all scores, (h, w), (h, w) and (count, h, w).

    ``others``: gray image, A (3, 3) and b (3,) of each neighbor; ``starts``: first inverse depth, (h, w).
    """
    height, width = reference.shape
    halo = WINDOW_RADIUS + SCORE_RADIUS
    rows = np.clip(np.arange(-halo, height + halo), 0, height - 1)
    columns = np.clip(np.arange(-halo, width + halo), 0, width - 1)
    x, y = np.meshgrid(columns.astype(float), rows.astype(float))
    r, q0 = (image[np.ix_(rows, columns)].astype(float) for image in (reference, starts))
    r_mean = means(r, WINDOW_RADIUS)
    r_spread = means(r * r, WINDOW_RADIUS) - r_mean**2 + NOISE
    scores = []
    for number in range(count):
        matches = []
        for image, turned, shift in others:
            to = turned @ np.stack([x, y, np.ones_like(x)]).reshape(3, -1)
            to = to.reshape(3, *x.shape) + (q0 + number * step) * shift[:, None, None]
            places = np.stack([to[1], to[0]]) / to[2]
            s = map_coordinates(image.astype(float), places, order=1, mode="nearest")
            s_mean = means(s, WINDOW_RADIUS)
            s_spread = means(s * s, WINDOW_RADIUS) - s_mean**2 + NOISE
            covariance = means(r * s, WINDOW_RADIUS) - r_mean * s_mean
            matches.append(covariance / np.sqrt(r_spread * s_spread))
        ordered = -np.sort(-np.stack(matches), axis=0)
        better = ordered[: (len(others) + 1) // 2]
        scores.append(means(better.mean(axis=0), SCORE_RADIUS))
    every = np.stack(scores)
    best = every.argmax(axis=0)
    inner = np.clip(best, 1, count - 2)
    before, top, after = (np.take_along_axis(every, (inner + k)[None], 0)[0] for k in (-1, 0, 1))
    is_inner = best == inner
    shift = np.where(is_inner, 0.5 * (before - after) / (before - 2 * top + after), 0.0)
    return starts + (best + shift) * step, np.where(is_inner, top, NO_SCORE), every


# Crosses tiles, and ends within one.
WIDTH, HEIGHT = TILE_WIDTH + 13, TILE_HEIGHT + 9


def texture(height: int, width: int, seed: int) -> np.ndarray:
    """Return a gray image with structure of a few pixels, (height, width), uint8."""
    noise = np.random.default_rng(seed).uniform(0, 255, (height, width)).astype(np.float32)
    soft = cv2.GaussianBlur(noise, (0, 0), 1.5)
    return cv2.normalize(soft, np.zeros_like(soft), 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


@pytest.mark.parametrize("count", [1, 4])
def test_the_sweep_equals_its_twin(count: int) -> None:
    rng = np.random.default_rng(count)
    whole = texture(HEIGHT + 16, WIDTH, 0)
    images = [whole[: HEIGHT + 4 * i, : WIDTH - 3 * i] for i in range(count + 1)]
    tilts = np.eye(3) + rng.normal(scale=(0.02, 0.02, 2e-5), size=(count, 3, 3)).swapaxes(1, 2)
    shifts = rng.normal(scale=(20.0, 10.0, 0.02), size=(count, 3))
    starts = (0.03 * texture(HEIGHT, WIDTH, 9) / 255 - 0.1).astype(np.float32)
    view_form: Any = SweptView.numpy_dtype()
    pair_form: Any = SweptPair.numpy_dtype()
    views: Any = np.zeros(count + 1, view_form)
    pairs: Any = np.zeros(count, pair_form)
    views["start"] = np.cumsum([0, *(image.size for image in images[:-1])])
    views["height"], views["width"] = zip(*(image.shape for image in images), strict=True)
    views[0]["step"], views[0]["count"] = 0.03, 7
    pairs["view"], pairs["turned"], pairs["shift"] = np.arange(1, count + 1), tilts, shifts
    packed = wp.array(np.concatenate([multi_view_stereo._packed(i) for i in images]), dtype=int)
    inverse, scores = multi_view_stereo._swept(views, pairs, packed, starts)
    others = list(zip(images[1:], tilts, shifts, strict=True))
    expected, expected_scores, every = sweep_twin(images[0], others, starts, 0.03, 7)
    ordered = -np.sort(-every, axis=0)
    sure = ordered[0] - ordered[1] > 1e-3
    assert sure.mean() > 0.7
    np.testing.assert_allclose(scores[sure], expected_scores[sure], atol=2e-3)
    peaked = sure & (expected_scores > 0.1)
    assert peaked.mean() > 0.1
    np.testing.assert_allclose(inverse[peaked], expected[peaked], atol=2e-3)


def photographs(
    plain: int = 270, views: int = 7, size: tuple[int, int] = (400, 300)
) -> list[Frame]:
    """Return views from an arc of a textured plane at z = 0; so many of its 800 columns are plain."""
    k = Intrinsics.from_fov(*size, 45.0)
    plane = texture(800, 800, 3)
    plane[:, :plain] = 120
    frames = []
    for i, angle in enumerate(np.radians(np.linspace(-24, 24, views))):
        pose = np.eye(4)
        pose[:3, :3] = cv2.Rodrigues(np.array([0.0, -angle, 0.0]))[0]
        pose[:3, 3] = pose[:3, :3] @ [0.0, 0.0, -2.0]
        camera = Camera(k, pose)
        move = camera.cam_from_world
        matrix = np.array([[k.fx, 0, k.cx - 0.5], [0, k.fy, k.cy - 0.5], [0, 0, 1]])
        # Pixel of the texture -> metres on the plane -> image.
        metres = np.array([[2.5 / 800, 0, -1.25], [0, 2.5 / 800, -1.25], [0, 0, 1]])
        to = matrix @ np.column_stack([move[:3, 0], move[:3, 1], move[:3, 3]]) @ metres
        image = cv2.warpPerspective(plane, to, size, flags=cv2.INTER_AREA)
        layers = {Layer.IMAGE: np.repeat(image[..., None], 3, axis=2)}
        frames.append(Frame(f"{i:04d}", camera, float(i), layers))
    return frames


def on_the_plane(count: int = 300) -> np.ndarray:
    """Return points around the plane, as a structure from motion would with errors, (count, 3)."""
    points = np.random.default_rng(5).uniform(-0.8, 0.8, (count, 3))
    return points * [1.0, 1.0, 0.3]


def true_depth(camera: Camera) -> np.ndarray:
    k = camera.intrinsics
    u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
    rays = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones_like(u)], axis=-1)
    world = rays @ camera.world_from_cam[:3, :3].T
    return -camera.center_world[2] / world[..., 2]


def test_depth_is_found_where_there_is_texture_and_only_there() -> None:
    found, share = matched_depth(photographs(), on_the_plane())
    assert len(found) == 7
    middle = found[3]
    depth, true = middle.load_depth(), true_depth(middle.camera)
    known = np.isfinite(depth)
    error = np.abs(depth - true)[known] / true[known]
    assert np.median(error) < 2e-3
    assert np.quantile(error, 0.95) < 0.01
    # Plain is what the texture's first 270 of 800 columns show; around it, windows reach into texture.
    u = middle.camera.intrinsics
    edge = u.cx + u.fx * (270 * 2.5 / 800 - 1.25) / 2.0
    assert known[40:-40, int(edge) + 12 : -40].mean() > 0.95
    assert known[:, : int(edge) - 12].mean() < 0.02
    assert 0.5 < share < 0.8


def test_masks_are_respected_and_counted() -> None:
    frames = photographs()
    mask = np.zeros((300, 400), np.uint8)
    mask[100:200, 220:300] = 255
    masked = [f.with_layer(Layer.MASK, mask) for f in frames]
    found, share = matched_depth(masked, on_the_plane(), 20)
    depth = found[3].load_depth()
    assert not np.isfinite(depth[mask == 0]).any()
    assert np.isfinite(depth[mask > 0]).mean() > 0.9
    assert share > 0.85


def test_two_views_cannot_agree_with_a_third() -> None:
    _, share = matched_depth(photographs(views=2), on_the_plane())
    assert share == 0.0


def test_photographs_start_from_their_depth() -> None:
    recorded = PointCloud(on_the_plane().astype(np.float32), np.full((300, 3), 0.5, np.float32))
    config = InitConfig(strategy="mvs")
    start = initialize(photographs(), config, subject="scene", recorded=recorded)
    assert start.strategy is None
    assert start.sources["depth"] > 3000
    near = start.points.points_world[: start.sources["depth"]]
    assert np.median(np.abs(near[:, 2])) < 0.01


def test_around_little_texture_the_rest_of_a_scene_is_guessed() -> None:
    recorded = PointCloud(on_the_plane().astype(np.float32), np.full((300, 3), 0.5, np.float32))
    frames, config = photographs(plain=640), InitConfig(strategy="mvs", target_points=1000)
    assert LEAST_MATCHED["scene"] < matched_depth(frames, on_the_plane())[1] < 0.14
    start = initialize(frames, config, subject="scene", recorded=recorded)
    assert start.strategy is None
    assert start.points.guessed is not None
    guessed = start.points.guessed[: start.sources["depth"]]
    assert 200 < guessed.sum() <= GUESSED_SHARE * 1000
    near = start.points.points_world[: start.sources["depth"]]
    assert np.median(np.abs(near[:, 2])) < 0.05


def test_plain_photographs_start_from_sparse_points(caplog) -> None:
    recorded = PointCloud(on_the_plane().astype(np.float32), np.full((300, 3), 0.5, np.float32))
    config = InitConfig(strategy="mvs")
    with caplog.at_level(logging.WARNING):
        start = initialize(photographs(plain=800), config, subject="scene", recorded=recorded)
    assert start.strategy == "default"
    assert start.sources["recorded"] == 300
    assert "little texture" in caplog.text
    assert initialize(photographs(plain=800), config, subject="scene").strategy == "random"
