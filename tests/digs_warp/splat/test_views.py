"""One renderer for views of many sizes, for parts of views, and for a changing number of Gaussians."""

import numpy as np
import pytest

from digs_warp.data.gaussians import Gaussians
from digs_warp.device.image_planes import ImagePlanes
from digs_warp.geometry.camera import Camera
from digs_warp.splat.backend import RasterBackend
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import SplatRenderer, render
from reference.plain_raster import ALL_BACKENDS, backend_name
from reference.splat_scenes import BACKGROUND, NEAR, camera, random_gaussians

MANY = random_gaussians(800, seed=1)
SIZE = (150, 110)
VIEW = camera(*SIZE, fx=140.0, fy=140.0)


def renderer_of(gaussians: Gaussians = MANY, **options) -> SplatRenderer:
    return SplatRenderer(DeviceGaussians.from_numpy(gaussians), *SIZE, **options)


def pulled_back(renderer: SplatRenderer, view: Camera, **options) -> tuple[np.ndarray, ...]:
    """The image, and the gradients for a gradient image that depends on the pixel alone."""
    k = view.intrinsics
    renderer.forward(view, near=NEAR, background=BACKGROUND, **options)
    renderer.adj_image.assign(gradient_image()[: k.height, : k.width])
    renderer.backward()
    return renderer.image.to_numpy(), *(a.numpy().copy() for a in renderer.gradients.arrays)


def gradient_image() -> np.ndarray:
    return np.random.default_rng(3).normal(size=(SIZE[1], SIZE[0], 3))


@pytest.mark.parametrize("size", [(75, 55), (41, 110), (150, 3), (1, 1)])
def test_a_smaller_view_equals_that_of_a_renderer_of_its_size(size: tuple[int, int]) -> None:
    small = VIEW.resized(*size)
    one = renderer_of()
    pulled_back(one, VIEW)
    found = pulled_back(one, small)
    expected = pulled_back(SplatRenderer(DeviceGaussians.from_numpy(MANY), *size), small)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)
    # And the large view is the same after the small one.
    for a, b in zip(pulled_back(one, VIEW), pulled_back(renderer_of(), VIEW), strict=True):
        np.testing.assert_array_equal(a, b)


def test_planes_read_zero_outside_of_a_smaller_image() -> None:
    planes = ImagePlanes(40, 30, 2)
    planes.assign(np.ones((30, 40, 2)))
    planes.resize(23, 30)
    planes.resize(23, 9)
    assert planes.to_numpy().shape == (9, 23, 2)
    assert planes.data.numpy().sum() == 2 * 23 * 9
    with pytest.raises(ValueError, match=r"41x9 px.*40x30 px"):
        planes.resize(41, 9)


@pytest.mark.parametrize("backend", ALL_BACKENDS, ids=backend_name)
def test_a_window_shows_the_pixels_of_the_whole_view(backend: RasterBackend) -> None:
    """Splitting an image changes nothing: same pixels, and gradients that add up to those of the whole."""
    whole = pulled_back(renderer_of(backend=backend), VIEW)
    image = np.full_like(whole[0], np.nan)
    sums = [np.zeros_like(a) for a in whole[1:]]
    part = renderer_of(backend=backend)
    for x0, x1 in ((0, 64), (64, 150)):
        for y0, y1 in ((0, 48), (48, 110)):
            found, *gradients = pulled_back(part, VIEW, window=(x0, y0, x1, y1))
            image[y0:y1, x0:x1] = found[y0:y1, x0:x1]
            for total, gradient in zip(sums, gradients, strict=True):
                total += gradient
    np.testing.assert_array_equal(image, whole[0])
    for total, gradient in zip(sums, whole[1:], strict=True):
        np.testing.assert_allclose(total, gradient, atol=1e-5 * np.abs(gradient).max())


def test_a_window_leaves_the_other_tiles_alone_and_reaches_out_to_whole_tiles() -> None:
    renderer = renderer_of()
    renderer.image.assign(np.full((SIZE[1], SIZE[0], 3), 7.0))
    renderer.forward(VIEW, near=NEAR, window=(70, 40, 71, 41))
    touched = (renderer.image.to_numpy() != 7.0).all(axis=-1)
    expected = np.zeros_like(touched)
    expected[32:48, 64:80] = True
    np.testing.assert_array_equal(touched, expected)
    assert renderer.binner.drawn_box() == (64, 32, 80, 48)


def test_an_empty_window_draws_nothing() -> None:
    renderer = renderer_of()
    renderer.forward(VIEW, near=NEAR, window=(0, 0, 0, 0))
    assert renderer.binner.total_pairs == 0
    renderer.backward()
    assert not renderer.gradients.means.numpy().any()


@pytest.mark.parametrize("count", [0, 10, 1700])
def test_other_gaussians_take_the_place_of_the_first(count: int) -> None:
    other = random_gaussians(count, seed=9)
    renderer = renderer_of()
    image = renderer.image
    pulled_back(renderer, VIEW)
    renderer.set_gaussians(DeviceGaussians.from_numpy(other))
    assert renderer.image is image
    found, expected = pulled_back(renderer, VIEW), pulled_back(renderer_of(other), VIEW)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("backend", ALL_BACKENDS, ids=backend_name)
def test_an_image_lies_behind_the_gaussians(backend: RasterBackend) -> None:
    behind = np.random.default_rng(5).uniform(size=(SIZE[1], SIZE[0], 3)).astype(np.float32)
    planes = ImagePlanes(*SIZE, 3)
    planes.assign(behind)
    renderer = renderer_of(backend=backend)
    renderer.forward(VIEW, near=NEAR, background=(0.0, 0.0, 0.0))
    alone, through = renderer.image.to_numpy(), renderer.transmittance.to_numpy()
    renderer.forward(VIEW, near=NEAR, background=planes)
    np.testing.assert_allclose(renderer.image.to_numpy(), alone + through * behind, atol=1e-6)


def test_a_constant_background_image_is_a_background_color() -> None:
    """In gradients, too: a splat that hides the background takes its light away."""
    planes = ImagePlanes(*SIZE, 3)
    planes.assign(np.broadcast_to(BACKGROUND, (SIZE[1], SIZE[0], 3)))
    renderer = renderer_of()
    expected = pulled_back(renderer, VIEW)
    renderer.forward(VIEW, near=NEAR, background=planes)
    renderer.backward()
    for array, wanted in zip(renderer.gradients.arrays, expected[1:], strict=True):
        np.testing.assert_allclose(array.numpy(), wanted, atol=1e-5 * np.abs(wanted).max())


def test_a_background_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match=r"background of 10x10 px with 3 channels"):
        renderer_of().forward(VIEW, near=NEAR, background=ImagePlanes(10, 10, 3))
    with pytest.raises(ValueError, match="background"):
        render(MANY, VIEW, background=np.zeros((10, 10, 3)))
