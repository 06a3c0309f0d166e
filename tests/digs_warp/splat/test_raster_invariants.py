"""What must hold whatever the scene: independence of threads and order, conserved weights, NaN kept out."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.data.gaussians import ANTIALIASED, FIELDS, Gaussians
from digs_warp.geometry.camera import Camera
from digs_warp.splat.backend import RasterBackend
from digs_warp.splat.config import EXPECTED, RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.renderer import SplatRenderer
from reference.splat_scenes import (
    BACKENDS,
    BACKGROUND,
    NEAR,
    backend_name,
    camera,
    hard_cases,
    random_gaussians,
)

MANY = random_gaussians(3000, seed=1)
SIZE = (200, 150)
VIEW = camera(*SIZE, fx=180.0, fy=180.0)


def rendered(gaussians: Gaussians, view: Camera = VIEW, **options) -> SplatRenderer:
    """Render and pull back a fixed random image gradient."""
    k = view.intrinsics
    renderer = SplatRenderer(DeviceGaussians.from_numpy(gaussians), k.width, k.height, **options)
    renderer.forward(view, near=NEAR, background=BACKGROUND)
    rng = np.random.default_rng(2)
    for planes in (renderer.adj_image, renderer.adj_depth):
        planes.assign(rng.normal(size=(k.height, k.width, planes.channels)))
    renderer.backward()
    return renderer


def pulled_back(renderer: SplatRenderer, view: Camera = VIEW) -> list[np.ndarray]:
    """The image, and the gradients for a gradient image that depends on the pixel alone."""
    k = view.intrinsics
    renderer.forward(view, near=NEAR, background=BACKGROUND)
    gradient = np.random.default_rng(3).normal(size=(SIZE[1], SIZE[0], 3))
    renderer.adj_image.assign(gradient[: k.height, : k.width])
    renderer.backward()
    return [renderer.image.to_numpy(), *gradients_of(renderer)]


def renderer_of(gaussians: Gaussians = MANY) -> SplatRenderer:
    return SplatRenderer(DeviceGaussians.from_numpy(gaussians), *SIZE)


def gradients_of(renderer: SplatRenderer) -> list[np.ndarray]:
    return [array.numpy().copy() for array in renderer.gradients.arrays]


def check_same(found: list[np.ndarray], wanted: list[np.ndarray]) -> None:
    for one, other in zip(found, wanted, strict=True):
        np.testing.assert_array_equal(one, other)


def test_same_bits_for_any_number_of_threads() -> None:
    options = RasterOptions(outputs="depth", depth_of="skin")
    one, more = (rendered(MANY, threads=count, options=options) for count in (1, 8))
    for name in ("image", "transmittance", "depth"):
        np.testing.assert_array_equal(getattr(one, name).to_numpy(), getattr(more, name).to_numpy())
    check_same(gradients_of(one), gradients_of(more))


def test_both_backends_agree() -> None:
    fast, plain = (rendered(MANY, backend=backend) for backend in BACKENDS)
    # A splat whose alpha lies within rounding of the cut moves a pixel by up to 1/255 of what shines
    # through: allowed in one pixel of a thousand.
    difference = np.abs(fast.image.to_numpy() - plain.image.to_numpy())
    assert np.quantile(difference, 0.999) < 4e-6
    assert difference.max() < 1 / 255
    # A thousand splats in one tile: many batches of them.
    assert np.diff(plain.binner.lists.tile_starts.numpy()).max() > 1000
    for a, b in zip(fast.gradients.arrays, plain.gradients.arrays, strict=True):
        assert np.linalg.norm(a.numpy() - b.numpy()) < 2e-5 * np.linalg.norm(b.numpy())


@pytest.mark.parametrize("backend", BACKENDS, ids=backend_name)
def test_the_mean_depth_alone_is_the_same(backend: RasterBackend) -> None:
    """What a training draws: without the median, and with the bits of a view that has both."""
    both, mean = (
        rendered(MANY, backend=backend, options=RasterOptions(outputs=outputs, depth_of="skin"))
        for outputs in ("depth", "mean depth")
    )
    assert mean.depth.channels == 1
    depths = both.depth.to_numpy()[..., EXPECTED]
    assert depths.max() > 0
    np.testing.assert_array_equal(mean.depth.to_numpy()[..., 0], depths)
    np.testing.assert_array_equal(mean.image.to_numpy(), both.image.to_numpy())
    check_same(gradients_of(mean), gradients_of(both))


@pytest.mark.parametrize("backend", BACKENDS, ids=backend_name)
def test_every_gradient_record_is_written(backend: RasterBackend) -> None:
    """Those behind saturated pixels, too: what an earlier view left there must not count."""
    scene = hard_cases()["saturated tiles"]
    renderer = rendered(scene.gaussians, scene.camera, backend=backend)
    once = gradients_of(renderer)
    renderer.binner.lists.pair_gradients.fill_(np.nan)
    renderer.backward()
    check_same(once, gradients_of(renderer))


def test_the_order_in_memory_does_not_matter() -> None:
    order = np.random.default_rng(0).permutation(len(MANY))
    shuffled = Gaussians(*(getattr(MANY, name)[order] for name in FIELDS))
    a, b = rendered(MANY), rendered(shuffled)
    np.testing.assert_array_equal(a.image.to_numpy(), b.image.to_numpy())
    check_same([before[order] for before in gradients_of(a)], gradients_of(b))


def test_buffers_grow_and_results_do_not_change() -> None:
    """Splats that each cover many tiles overflow the first buffers."""
    wide = replace(MANY, log_scales=MANY.log_scales + 1.5)
    renderer = rendered(wide)
    assert renderer.binner.total_pairs > 3 * len(wide) + 64
    first = renderer.image.to_numpy()
    renderer.forward(VIEW, near=NEAR, background=BACKGROUND)
    np.testing.assert_array_equal(renderer.image.to_numpy(), first)
    np.testing.assert_array_equal(rendered(wide, threads=1).image.to_numpy(), first)


def test_what_gaussians_are_made_for_is_drawn_without_being_asked() -> None:
    made_for = ANTIALIASED
    asked = RasterOptions(dilation=made_for.dilation, antialias=made_for.antialias)
    expected = rendered(MANY, options=asked).image.to_numpy()
    found = rendered(replace(MANY, screen_filter=made_for))
    np.testing.assert_array_equal(found.image.to_numpy(), expected)
    wider = rendered(MANY, options=replace(asked, dilation=2.0)).image.to_numpy()
    both = rendered(replace(MANY, screen_filter=made_for), options=RasterOptions(dilation=2.0))
    np.testing.assert_array_equal(both.image.to_numpy(), wider)
    found.set_gaussians(DeviceGaussians.from_numpy(MANY))
    found.forward(VIEW, near=NEAR, background=BACKGROUND)
    np.testing.assert_array_equal(found.image.to_numpy(), rendered(MANY).image.to_numpy())


@pytest.mark.parametrize("size", [(41, 110), (1, 1)])
def test_a_smaller_view_equals_that_of_a_renderer_of_its_size(size: tuple[int, int]) -> None:
    small = VIEW.resized(*size)
    one = renderer_of()
    pulled_back(one, VIEW)
    found = pulled_back(one, small)
    expected = pulled_back(SplatRenderer(DeviceGaussians.from_numpy(MANY), *size), small)
    check_same(found, expected)
    # And the large view is the same after the small one.
    check_same(pulled_back(one, VIEW), pulled_back(renderer_of(), VIEW))


@pytest.mark.parametrize("count", [0, 1700])
def test_other_gaussians_take_the_place_of_the_first(count: int) -> None:
    other = random_gaussians(count, seed=9)
    renderer = renderer_of()
    image = renderer.image
    pulled_back(renderer, VIEW)
    renderer.set_gaussians(DeviceGaussians.from_numpy(other))
    assert renderer.image is image
    check_same(pulled_back(renderer, VIEW), pulled_back(renderer_of(other), VIEW))
