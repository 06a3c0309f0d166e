"""Whatever the numbers: a finite view or a clear error, and no harm to the other Gaussians."""

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.splat.camera_motion import RowMotion
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians, SplatStatistics
from digs_warp.splat.render import SplatRenderer, render
from reference.splat_scenes import BACKGROUND, NEAR, camera, random_gaussians

MANY = random_gaussians(600, seed=1)
SIZE = (90, 70)
VIEW = camera(*SIZE, fx=80.0, fy=80.0)
ALL = RasterOptions(outputs="depth")
SOME = "nan inf -inf 1e38 -1e38 1e-40 -1e-40 0 -0.0 3.4e38 1e19 -1e10 1e30 -1e30 88 -104"
NASTY = np.array(SOME.split(), dtype=np.float32)


def renderer_of(gaussians: Gaussians, **options) -> SplatRenderer:
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
    middle = np.s_[30:40, 40:50]
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
