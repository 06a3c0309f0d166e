"""Motion blur: means of views along the exposure, with the gradients of the twin; none without motion."""

from dataclasses import fields, replace

import numpy as np
import pytest

from digs_warp.data.gaussians import Gaussians
from digs_warp.splat.blur_renderer import BLOCK, BlurRenderer
from digs_warp.splat.camera_motion import MOST_MOMENTS, Blur, RowMotion
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians, SplatStatistics
from digs_warp.splat.renderer import SplatRenderer
from reference.blur_twin import blurred_gradients, cameras_of, moments_of, render_blurred
from reference.splat_scenes import (
    BACKGROUND,
    NEAR,
    SplatScene,
    camera,
    random_gaussians,
    random_scene,
    rolling_scene,
)
from reference.splat_twin import Adjoints, Parameters

DEPTH = RasterOptions(outputs="depth")
HAND = RowMotion(np.array([0.06, -0.03, 0.08]), np.array([0.01, 0.02, -0.01]))
SMALL = random_scene(1, count=6)
SCENES = [SMALL, replace(SMALL, rows=rolling_scene(2).rows)]
IMAGE_TOLERANCE, GRADIENT_TOLERANCE = 1e-4, 2e-3


def blur_of(moments: int) -> Blur:
    found = Blur(HAND, float(moments))
    assert found.moments == moments
    return found


def adjoints_of(clear: np.ndarray) -> Adjoints:
    rng = np.random.default_rng(0)
    image = rng.normal(size=(*clear.shape, 3)) * clear[..., None]
    transmittance, depth = (rng.normal(size=clear.shape) * clear for _ in range(2))
    return Adjoints(image, transmittance, depth)


def drawn(scene: SplatScene, blur: Blur | None, adjoints: Adjoints, **more: int) -> BlurRenderer:
    k = scene.camera.intrinsics
    splats = DeviceGaussians.from_numpy(scene.gaussians)
    renderer = BlurRenderer(splats, k.width, k.height, options=DEPTH, moments=5, **more)
    renderer.statistics = SplatStatistics.zeros(len(splats))
    renderer.forward(
        scene.camera, near=scene.near, background=BACKGROUND, rows=scene.rows, blur=blur
    )
    renderer.adj_image.assign(adjoints.image)
    renderer.adj_transmittance.assign(adjoints.transmittance)
    renderer.middle.adj_depth.assign(adjoints.depth * renderer.moments)
    renderer.backward()
    return renderer


@pytest.mark.parametrize("scene", SCENES, ids=["global", "rolling"])
@pytest.mark.parametrize(("moments", "block"), [(2, BLOCK), (3, BLOCK), (2, 1)])
def test_image_and_gradients_equal_the_twin(
    scene: SplatScene, moments: int, block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A GPU has a thread for each value of a gradient.
    monkeypatch.setattr("digs_warp.splat.blur_renderer.values_per_thread", lambda *_: block)
    cameras = cameras_of(scene, HAND, moments)
    twin = render_blurred(scene, cameras, BACKGROUND, DEPTH)
    assert twin.ambiguous.mean() <= 0.1
    clear = ~twin.ambiguous
    adjoints = adjoints_of(clear)
    renderer = drawn(scene, blur_of(moments), adjoints)
    for planes, wanted in (
        (renderer.image, twin.image),
        (renderer.transmittance, twin.transmittance),
        (renderer.middle.depth, twin.depth),
    ):
        found = planes.to_numpy()
        found = found if wanted.ndim == 3 else found[..., 0]
        np.testing.assert_allclose(found[clear], wanted[clear], rtol=0, atol=IMAGE_TOLERANCE)
    gradients = blurred_gradients(scene, cameras, BACKGROUND, adjoints, DEPTH)
    for field, array in zip(fields(Parameters), renderer.gradients.arrays, strict=True):
        wanted = getattr(gradients, field.name)
        limit = GRADIENT_TOLERANCE * np.abs(wanted).max()
        found = array.numpy().reshape(wanted.shape)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=limit, err_msg=field.name)
    counts = renderer.statistics
    assert counts is not None and counts.counts.numpy().max() == moments


def test_the_moments_have_the_variance_of_an_exposure() -> None:
    for count in range(2, MOST_MOMENTS + 1):
        assert np.mean(moments_of(count)) == pytest.approx(0)
        assert np.mean(moments_of(count) ** 2) == pytest.approx(1 / 12)
        cameras = cameras_of(random_scene(0), HAND, count)
        for found, wanted in zip(blur_of(count).cameras(camera()), cameras, strict=True):
            np.testing.assert_allclose(found.world_from_cam, wanted.world_from_cam, atol=1e-12)


@pytest.mark.parametrize("blur", [None, Blur(HAND, 0.4)])
def test_a_sharp_view_has_the_bits_of_the_plain_renderer(blur: Blur | None) -> None:
    scene = random_scene(1)
    k = scene.camera.intrinsics
    adjoints = adjoints_of(np.ones((k.height, k.width), bool))
    renderer = drawn(scene, blur_of(3), adjoints)  # leftovers of a blurred view
    renderer = drawn(scene, blur, adjoints)
    plain = SplatRenderer(
        DeviceGaussians.from_numpy(scene.gaussians), k.width, k.height, options=DEPTH
    )
    plain.forward(scene.camera, near=NEAR, background=BACKGROUND)
    plain.adj_image.assign(adjoints.image)
    plain.adj_transmittance.assign(adjoints.transmittance)
    plain.adj_depth.assign(adjoints.depth)
    plain.backward()
    assert renderer.moments == 1
    np.testing.assert_array_equal(renderer.image.to_numpy(), plain.image.to_numpy())
    np.testing.assert_array_equal(renderer.transmittance.to_numpy(), plain.transmittance.to_numpy())
    for found, wanted in zip(renderer.gradients.arrays, plain.gradients.arrays, strict=True):
        np.testing.assert_array_equal(found.numpy(), wanted.numpy())


def test_the_number_of_threads_changes_no_bit() -> None:
    scene = random_scene(2, count=40)
    k = scene.camera.intrinsics
    adjoints = adjoints_of(np.ones((k.height, k.width), bool))
    one, three = (drawn(scene, blur_of(3), adjoints, threads=threads) for threads in (1, 3))
    np.testing.assert_array_equal(one.image.to_numpy(), three.image.to_numpy())
    for found, wanted in zip(one.gradients.arrays, three.gradients.arrays, strict=True):
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


def test_a_view_of_more_moments_than_there_is_room_for_is_named() -> None:
    renderer = BlurRenderer(DeviceGaussians.from_numpy(random_gaussians(3, seed=0)), 41, 37)
    with pytest.raises(ValueError, match="view of 2 moments, renderer of 1"):
        renderer.forward(camera(), near=NEAR, blur=blur_of(2))
