"""What must hold whatever the scene: independence of threads and order, finite views, clear errors."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import ANTIALIASED, FIELDS, Gaussians
from digs_warp.geometry.camera import Camera
from digs_warp.splat.backend import RasterBackend
from digs_warp.splat.camera_motion import RowMotion
from digs_warp.splat.config import EXPECTED, RasterOptions
from digs_warp.splat.device import DeviceGaussians, SplatStatistics
from digs_warp.splat.render import SplatRenderer, render
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


ALL = RasterOptions(outputs="depth")
SOME = "nan inf -inf 1e38 -1e38 1e-40 -1e-40 0 -0.0 3.4e38 1e19 -1e10 1e30 -1e30 88 -104"
NASTY = np.array(SOME.split(), dtype=np.float32)


def renderer_of(gaussians: Gaussians = MANY, **options) -> SplatRenderer:
    renderer = SplatRenderer(DeviceGaussians.from_numpy(gaussians), *SIZE, **options)
    renderer.statistics = SplatStatistics.zeros(len(gaussians))
    return renderer


def check_finite_view(renderer: SplatRenderer) -> None:
    """Draw and pull back: everything must be finite."""
    renderer.forward(VIEW, near=NEAR, background=BACKGROUND)
    rng = np.random.default_rng(0)
    for planes in (renderer.adj_image, renderer.adj_depth):
        planes.assign(rng.normal(size=(SIZE[1], SIZE[0], planes.channels)))
    renderer.backward()
    for planes in (renderer.image, renderer.transmittance, renderer.depth):
        assert np.isfinite(planes.to_numpy()).all()
    for name, array in zip(FIELDS, renderer.gradients.arrays, strict=True):
        assert np.isfinite(array.numpy()).all(), name
    assert renderer.statistics is not None
    for array in vars(renderer.statistics).values():
        assert np.isfinite(array.numpy()).all()


@pytest.mark.parametrize(("seed", "antialias"), [(seed, seed % 2 == 1) for seed in range(4)])
def test_a_device_array_full_of_nonsense_gives_a_finite_view(seed: int, antialias: bool) -> None:
    """Behind the door: values that an optimizer might produce, in a third of all Gaussians."""
    rng = np.random.default_rng(seed)
    renderer = renderer_of(MANY, options=RasterOptions(outputs="depth", antialias=antialias))
    for array in renderer.gaussians.arrays:
        values = array.numpy().copy()
        flat = values.reshape(-1)
        where = rng.random(flat.shape) < 0.1
        flat[where] = rng.choice(NASTY, size=int(where.sum()))
        array.assign(values)
    check_finite_view(renderer)


@pytest.mark.parametrize("value", [np.nan, 1e30])
@pytest.mark.parametrize("field", FIELDS)
def test_a_broken_gaussian_hurts_nobody_else(field: str, value: float) -> None:
    renderer = renderer_of(MANY, options=ALL)
    values = getattr(renderer.gaussians, field).numpy().copy()
    values[5] = value
    getattr(renderer.gaussians, field).assign(values)
    check_finite_view(renderer)
    if not np.isfinite(value):
        others = MANY.select(np.arange(len(MANY)) != 5)
        expected = renderer_of(others)
        expected.forward(VIEW, near=NEAR, background=BACKGROUND)
        drawn = renderer.image.to_numpy()
        limit = 0 if field != "opacity_logits" or np.isnan(value) else 1
        assert np.abs(drawn - expected.image.to_numpy()).max() <= limit


def test_the_door_refuses_values_that_are_not_finite() -> None:
    for field in FIELDS:
        broken = Gaussians(*(getattr(MANY, name).copy() for name in FIELDS))
        getattr(broken, field).reshape(-1)[[3, 7]] = (np.nan, np.inf)
        with pytest.raises(DigsError, match=rf"{field}: 2 of \d+ values are NaN or infinite"):
            render(broken, VIEW)


def test_thousands_of_opaque_gaussians_in_one_place() -> None:
    """Two saturate a pixel (1 - 0.99^2 leaves 1e-4): those behind must not show, nor take forever."""
    count = 5000
    one = random_gaussians(1, seed=3, degree=0)
    pile = Gaussians(*(np.repeat(getattr(one, name), count, axis=0) for name in FIELDS))
    pile.means[:] = 0.0
    pile.log_scales[:] = np.log(0.3)
    pile.opacity_logits[:] = 40.0
    pile.sh[:] = np.random.default_rng(0).normal(size=pile.sh.shape) * 0.3
    renderer = renderer_of(pile, options=ALL)
    check_finite_view(renderer)
    few = renderer_of(pile.select(np.arange(300)))
    few.forward(VIEW, near=NEAR, background=BACKGROUND)
    middle = np.s_[57:67, 107:117]
    np.testing.assert_array_equal(renderer.image.to_numpy()[middle], few.image.to_numpy()[middle])


def test_a_near_plane_a_background_or_a_motion_that_is_none_is_refused() -> None:
    for near in (np.nan, np.inf, 0.0, -1.0):
        with pytest.raises(DigsError, match="near plane"):
            render(MANY, VIEW, near=near)
    with pytest.raises(DigsError, match=r"background.*NaN"):
        render(MANY, VIEW, background=(np.nan, 0.0, 0.0))
    with pytest.raises(DigsError, match=r"background.*shape"):
        render(MANY, VIEW, background=(0.0, 0.0))  # pyright: ignore[reportArgumentType]
    with pytest.raises(DigsError, match=r"turn: .*NaN"):
        RowMotion(np.full(3, np.nan), np.zeros(3))
    with pytest.raises(DigsError, match=r"shift: shape \(2,\)"):
        RowMotion(np.zeros(3), np.zeros(2))


def test_options_out_of_range_are_refused() -> None:
    for change, found in (
        ({"dilation": float("nan")}, "dilation: nan"),
        ({"outputs": "colors"}, "outputs: 'colors'"),
        ({"depth_of": "edge"}, "depth_of: 'edge', expected center, skin"),
    ):
        with pytest.raises(DigsError, match=found):
            RasterOptions(**change)  # pyright: ignore[reportArgumentType]
