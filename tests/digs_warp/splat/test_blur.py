"""Motion blur: means of sharp views along the exposure, and of their gradients; none without motion."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.data.gaussians import Gaussians
from digs_warp.splat.blur_renderer import BlurRenderer
from digs_warp.splat.camera_motion import MOST_MOMENTS, Blur, RowMotion
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians, SplatStatistics
from digs_warp.splat.renderer import SplatRenderer
from reference.splat_scenes import (
    BACKGROUND,
    NEAR,
    SplatScene,
    camera,
    random_gaussians,
    random_scene,
    rolling_scene,
)
from reference.splat_twin import pose_at

DEPTH = RasterOptions(outputs="depth")
HAND = RowMotion(np.array([0.06, -0.03, 0.08]), np.array([0.01, 0.02, -0.01]))
SMALL = random_scene(1, count=6)
WIDTH, HEIGHT = SMALL.camera.intrinsics.width, SMALL.camera.intrinsics.height
RNG = np.random.default_rng(0)
ADJ_IMAGE, ADJ_ALPHA, ADJ_DEPTH = (RNG.normal(size=(HEIGHT, WIDTH, n)) for n in (3, 1, 1))


def blur_of(moments: int) -> Blur:
    found = Blur(HAND, float(moments))
    assert found.moments == moments
    return found


def drawn(scene: SplatScene, blur: Blur | None, **more: int) -> BlurRenderer:
    """A renderer that has drawn a view, after one of three moments, and pulled the adjoints back."""
    splats = DeviceGaussians.from_numpy(scene.gaussians)
    renderer = BlurRenderer(splats, WIDTH, HEIGHT, options=DEPTH, moments=5, **more)
    for each in (blur_of(3), blur):
        renderer.statistics = SplatStatistics.zeros(len(splats))
        view = {"near": scene.near, "background": BACKGROUND, "rows": scene.rows}
        renderer.forward(scene.camera, **view, blur=each)  # pyright: ignore[reportArgumentType]
        renderer.adj_image.assign(ADJ_IMAGE)
        renderer.adj_transmittance.assign(ADJ_ALPHA)
        renderer.middle.adj_depth.assign(ADJ_DEPTH * renderer.moments)
        renderer.backward()
    return renderer


def sharp(scene: SplatScene, blur: Blur | None, number: int) -> SplatRenderer:
    """One moment alone; the first has depth."""
    splats = DeviceGaussians.from_numpy(scene.gaussians)
    renderer = SplatRenderer(splats, WIDTH, HEIGHT, options=DEPTH)
    cameras = [scene.camera] if blur is None else blur.cameras(scene.camera)
    renderer.forward(cameras[number], near=scene.near, background=BACKGROUND, rows=scene.rows)
    renderer.adj_image.assign(ADJ_IMAGE)
    renderer.adj_transmittance.assign(ADJ_ALPHA)
    renderer.adj_depth.assign(ADJ_DEPTH * (len(cameras) if number == 0 else 0.0))
    renderer.backward()
    return renderer


@pytest.mark.parametrize("rolls", [False, True], ids=["global", "rolling"])
@pytest.mark.parametrize("moments", [2, 3])
def test_image_and_gradients_are_means_of_sharp_ones(rolls: bool, moments: int) -> None:
    scene = replace(SMALL, rows=rolling_scene(2).rows) if rolls else SMALL
    renderer = drawn(scene, blur_of(moments))
    views = [sharp(scene, blur_of(moments), number) for number in range(moments)]
    for name in ("image", "transmittance"):
        wanted = np.mean([getattr(view, name).to_numpy() for view in views], axis=0)
        np.testing.assert_allclose(getattr(renderer, name).to_numpy(), wanted, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(renderer.middle.depth.to_numpy(), views[0].depth.to_numpy())
    arrays = zip(*(view.gradients.arrays for view in views), strict=True)
    for found, each in zip(renderer.gradients.arrays, arrays, strict=True):
        wanted = np.mean([array.numpy() for array in each], axis=0)
        limit = 1e-5 * np.abs(wanted).max()
        np.testing.assert_allclose(found.numpy(), wanted, rtol=0, atol=limit)
    counts = renderer.statistics
    assert counts is not None and counts.counts.numpy().max() == moments


def test_the_moments_have_the_variance_of_an_exposure() -> None:
    for count in range(2, MOST_MOMENTS + 1):
        even = np.arange(count) - (count - 1) / 2
        moments = np.array(sorted(even, key=abs)) * np.sqrt(1 / 12 / np.mean(even**2))
        wanted = pose_at(camera(), HAND, moments)
        found = [each.world_from_cam for each in blur_of(count).cameras(camera())]
        np.testing.assert_allclose(found, wanted, atol=1e-12)


@pytest.mark.parametrize("blur", [None, Blur(HAND, 0.4)])
def test_a_sharp_view_has_the_bits_of_the_plain_renderer(blur: Blur | None) -> None:
    renderer, plain = drawn(SMALL, blur), sharp(SMALL, None, 0)
    assert renderer.moments == 1
    np.testing.assert_array_equal(renderer.image.to_numpy(), plain.image.to_numpy())
    np.testing.assert_array_equal(renderer.transmittance.to_numpy(), plain.transmittance.to_numpy())
    for found, wanted in zip(renderer.gradients.arrays, plain.gradients.arrays, strict=True):
        np.testing.assert_array_equal(found.numpy(), wanted.numpy())


def test_every_moment_shows_the_background_where_the_others_have_splats() -> None:
    """A splat that crosses the image meanwhile: content is only the middle of it."""
    one = random_gaussians(1, seed=0)
    dot = Gaussians(np.zeros((1, 3)), one.log_scales, one.quats, np.full(1, 4.0), one.sh)
    far = camera(600, 40, fx=500.0, fy=500.0, cx=300.0, cy=20.0)
    blur = Blur(RowMotion(np.array([0.0, 0.9, 0.0]), np.zeros(3)), 2.0)
    images = []
    for content in (None, (296, 12, 304, 28)):
        renderer = BlurRenderer(DeviceGaussians.from_numpy(dot), 600, 40, moments=2)
        for planes in (renderer.image, *(each.image for each in renderer._renderers)):
            planes.assign(np.full((40, 600, 3), 7.0))
        renderer.forward(far, near=NEAR, background=BACKGROUND, content=content, blur=blur)
        x0, y0, x1, y1 = renderer.drawn_box()
        assert x1 - x0 > 200
        images.append(renderer.image.to_numpy()[y0:y1, x0:x1])
    np.testing.assert_array_equal(*images)
