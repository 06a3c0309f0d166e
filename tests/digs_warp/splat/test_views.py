"""One renderer for views of many sizes, for parts of views, and for a changing number of Gaussians."""

import numpy as np
import pytest

from digs_warp.data.gaussians import Gaussians
from digs_warp.device.image_planes import ImagePlanes
from digs_warp.geometry.camera import Camera
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import SplatRenderer
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


@pytest.mark.parametrize("size", [(41, 110), (1, 1)])
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


@pytest.mark.parametrize("count", [0, 1700])
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
