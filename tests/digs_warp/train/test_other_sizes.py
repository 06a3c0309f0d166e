"""Views from other distances: an exact score at the size of the photographs, and a lower one for gaps."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.sh import sh_from_rgb
from digs_warp.measure.scores import ViewScore
from digs_warp.splat.camera_motion import STILL, Blur
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.evaluate import Rendering, TestView, drawn_views, measure_views, render_views
from digs_warp.train.other_sizes import (
    MOST_VIEWS,
    SIZES,
    at_size,
    measure_other_sizes,
    psnr_at_size,
)

WIDTH, HEIGHT, FOCAL = 64, 48, 60.0
# At 1 m from the camera; the focal length makes a pixel this large there [m].
PIXEL = 1.0 / FOCAL
# Variance of the dilation of 3DGS [px^2].
DILATION = 0.3
DILATED = RasterOptions(dilation=DILATION)
AS_THEY_ARE = RasterOptions(dilation=1e-3)


def sheet(spacing: float, deviation: float, opacity: float, size: int) -> DeviceGaussians:
    """Round splats at 1 m, on a grid of ``size`` x ``size``; spacing and deviation in pixels."""
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(*[(np.arange(size) - (size - 1) / 2) * spacing * PIXEL] * 2)
    count = size * size
    means = np.stack([x.ravel(), y.ravel(), np.ones(count)], axis=1)
    means[:, :2] += rng.uniform(-0.5, 0.5, (count, 2)) * PIXEL
    colors = np.repeat(rng.uniform(0.1, 0.4, (count // size, 3)), size, axis=0)
    return DeviceGaussians.from_numpy(
        Gaussians(
            means,
            np.full((count, 3), np.log(deviation * PIXEL)),
            np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
            np.full(count, np.log(opacity / (1 - opacity))),
            sh_from_rgb(colors)[:, None],
        )
    )


def blank_view(name: str = "0000") -> TestView:
    """A camera at the origin, and a white photograph that is all object."""
    intrinsics = Intrinsics(WIDTH, HEIGHT, FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2)
    white = np.ones((HEIGHT, WIDTH, 3), np.float32)
    whole = np.ones((HEIGHT, WIDTH), bool)
    return TestView(name, Camera(intrinsics, np.eye(4)), white, white[..., 0], whole)


def test_the_size_of_the_photographs_gives_the_usual_score() -> None:
    """The photograph is brighter than the scene, which the gain makes up for."""
    scene = sheet(1.0, 0.6, 0.8, 20)
    brighter = 1.2 * render_views(scene, [blank_view()])[0].image
    view = replace(blank_view(), target=np.minimum(brighter, 1.0))
    score = measure_views(scene, [view]).scores[0]
    assert score.psnr_object_aligned > score.psnr_object + 1
    assert psnr_at_size(scene, [view], 1.0) == score.psnr_object_aligned


def drawn_with(scene: DeviceGaussians, view: TestView, options: RasterOptions) -> Rendering:
    return next(iter(drawn_views(scene, [view], options)))


def test_a_scene_that_erodes_when_drawn_larger_loses_and_a_filtered_one_does_not() -> None:
    """Both give the same photograph at its own size: one by dilation on the screen, one by its splats."""
    thin, filtered = sheet(1.0, 1e-3, 0.95, 24), sheet(1.0, DILATION**0.5, 0.95, 24)
    image = drawn_with(filtered, blank_view(), AS_THEY_ARE).image
    inside = image.min(axis=2) < 0.95
    view = replace(
        blank_view(), target=image, share=inside.astype(np.float32), object_pixels=inside
    )
    at = {
        name: (
            psnr_at_size(thin, [view], size, DILATED),
            psnr_at_size(filtered, [view], size, AS_THEY_ARE),
        )
        for name, size in (SIZES | {"trained": 1.0}).items()
    }
    assert min(at["trained"]) > 40
    assert at["double"][0] < 15 < 25 < at["double"][1]
    assert at["double"][0] < at["four_thirds"][0] - 2 < at["trained"][0] - 4
    assert at["half"][1] > at["half"][0] + 2


def test_a_view_from_afar_has_the_photograph_of_fewer_pixels() -> None:
    rng = np.random.default_rng(1)
    share, unknown = np.zeros((HEIGHT, WIDTH), np.float32), np.zeros((HEIGHT, WIDTH), bool)
    share[10:20, 11:31] = 1.0
    unknown[4, 7] = True
    view = replace(
        blank_view(),
        target=rng.uniform(0, 1, (HEIGHT, WIDTH, 3)).astype(np.float32),
        share=share,
        object_pixels=share > 0.5,
        unknown=unknown,
        rows=STILL,
        blur=Blur(STILL, 5.0),
    )
    half = at_size(view, 0.5)
    blocks = view.target.reshape(HEIGHT // 2, 2, WIDTH // 2, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(half.target, blocks, atol=1e-6)
    assert half.object_pixels.sum() == 5 * 11  # the rim, half covered, is the object's
    assert half.unknown is not None
    assert np.argwhere(half.unknown).tolist() == [[2, 3]]
    assert (half.camera.intrinsics.width, half.camera.intrinsics.fx) == (WIDTH // 2, FOCAL / 2)
    assert half.rows is view.rows  # counted in heights of the image
    double = at_size(view, 2.0)
    assert double.target is view.target
    assert half.blur is not None and double.blur is not None
    assert (half.blur.pixels, double.blur.pixels) == (2.5, 10.0)


def test_a_few_views_spread_over_all_are_drawn() -> None:
    scene = sheet(1.0, 0.6, 0.8, 4)
    views = [blank_view(f"{number:04}") for number in range(20)]
    scores = [ViewScore(name=v.name, psnr_object_aligned=float(n)) for n, v in enumerate(views)]
    found = measure_other_sizes(scene, views, scores)
    assert found is not None
    assert (found.views, found.trained) == (MOST_VIEWS, np.mean([0, 2, 5, 7, 10, 12, 15, 17]))
    assert found.half == pytest.approx(psnr_at_size(scene, views[:1], 0.5))
    assert measure_other_sizes(scene, [], []) is None
