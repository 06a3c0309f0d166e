"""Fields kept as rows, the texture of images and the failures of weak texture, against float64 NumPy."""

import numpy as np
import pytest

from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.effects.weak_texture import (
    STRIP_ERROR,
    STRIP_GROWTH,
    WRONG,
    WeakTextureFields,
    apply_weak_texture,
)
from digs_warp.sim.sensor.frame import Sensed
from digs_warp.sim.sensor.noise_field import UNREACHED, level_above, normal_rows
from digs_warp.sim.sensor.row_field import interpolated, spline_taps, stretched
from digs_warp.sim.sensor.tables import LogTable
from digs_warp.sim.sensor.texture import BLOCK, LEAST_GRADIENT, measure_texture
from reference.weak_texture_twin import (
    block_means,
    gradient_of,
    linear_weights,
    spline_weights,
    weak_texture,
    windowed_rms,
)

SHAPES = [(1, 1), (1, 40), (40, 1), (3, 3), (21, 66), (30, 200)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("steps", [(1.8, 3.3), (4.33, 41.6)])
def test_a_field_of_splines_is_the_sum_of_all_splines(
    shape: tuple[int, int], steps: tuple[float, float]
) -> None:
    (down, rows), (across, columns) = (
        spline_taps(size, step, offset)
        for size, step, offset in zip(shape, steps, (0.3, 0.9), strict=True)
    )
    grid = np.random.default_rng(0).standard_normal((rows, columns))
    expected = (
        spline_weights(shape[0], steps[0], 0.3, rows)
        @ grid
        @ spline_weights(shape[1], steps[1], 0.9, columns).T
    )
    np.testing.assert_allclose(stretched(grid, down, across, shape).image(), expected, atol=2e-5)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_coarse_map_is_interpolated_between_the_middles_of_its_cells(
    shape: tuple[int, int],
) -> None:
    cells = tuple(-(-size // BLOCK) for size in shape)
    grid = np.random.default_rng(1).uniform(0, 5, cells)
    expected = (
        linear_weights(shape[0], BLOCK, cells[0])
        @ grid
        @ linear_weights(shape[1], BLOCK, cells[1]).T
    )
    image = interpolated(grid.astype(np.float32), BLOCK, shape).image()
    np.testing.assert_allclose(image, expected, atol=1e-5)


def test_normal_rows_have_variance_one_everywhere_and_the_asked_correlation() -> None:
    fields = np.stack(
        [normal_rows(np.random.default_rng(n), (90, 150), 10.0, 5.0).image() for n in range(60)]
    )
    assert fields.mean() == pytest.approx(0, abs=0.02)
    assert fields.std() == pytest.approx(1, abs=0.02)
    assert fields.std(axis=0).min() > 0.6
    along = np.mean(fields[:, :, 10:] * fields[:, :, :-10])
    across = np.mean(fields[:, 5:] * fields[:, :-5])
    assert along == pytest.approx(1 / np.e, abs=0.04)
    assert across == pytest.approx(1 / np.e, abs=0.04)


@pytest.mark.parametrize("window", [1, 5, 9])
@pytest.mark.parametrize("shape", SHAPES)
def test_texture_is_that_of_the_formulas(shape: tuple[int, int], window: int) -> None:
    gray = np.random.default_rng(2).integers(0, 256, shape).astype(np.uint8)
    gray[:, : shape[1] // 3] = 128  # plain: sums must leave nothing behind
    texture = measure_texture(gray, window)
    gradient = gradient_of(gray)
    rms = windowed_rms(gradient, window)
    np.testing.assert_allclose(texture.gradient, rms, rtol=1e-6, atol=1e-6)
    logarithms = block_means(np.log(np.abs(gradient) + LEAST_GRADIENT), BLOCK)
    np.testing.assert_allclose(texture.logarithms, logarithms, atol=1e-5)
    np.testing.assert_allclose(texture.energies, block_means(rms**2, BLOCK), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
def test_weak_texture_fails_as_pixel_by_pixel(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(3)
    names = ("noise", "sigma", "strips", "wrong_level", "lost_level", "patches", "patch_level")
    cells = [-(-size // BLOCK) for size in shape]
    fields = WeakTextureFields(
        **{
            name: interpolated(rng.standard_normal(cells, dtype=np.float32), BLOCK, shape)
            for name in names
        }
    )
    before = rng.uniform(5, 90, shape).astype(np.float32)
    before[rng.random(shape) < 0.1] = np.nan
    disparity, cause = before.copy(), np.zeros(shape, np.uint8)
    confidence = np.ones(shape, np.float32)
    apply_weak_texture(Sensed(disparity, cause, confidence), fields)
    images = {name: getattr(fields, name).image().astype(np.float64) for name in names}
    expected, failed, lost = weak_texture(
        before.astype(np.float64), images, STRIP_ERROR, STRIP_GROWTH, WRONG
    )
    np.testing.assert_allclose(disparity, expected, rtol=1e-5)
    np.testing.assert_array_equal(cause, np.where(failed, Cause.WEAK_TEXTURE, Cause.OK))
    np.testing.assert_array_equal(confidence, np.where(lost, 0.0, np.where(failed, 0.5, 1.0)))


def test_a_table_by_logarithm_is_the_curve() -> None:
    places, values = (0.05, 0.2, 1.5, 6.0), (1.1, 0.6, 0.3, 0.0)
    arguments = np.geomspace(1e-3, 100, 500).astype(np.float32)
    looked_up = LogTable(places, values).at(np.log(arguments))
    np.testing.assert_allclose(looked_up, np.interp(arguments, places, values), atol=3e-3)
    from_zero = LogTable((0.0, 0.1, 1.0), (0.0, 0.5, 1.0)).at(np.log(arguments))
    np.testing.assert_allclose(
        from_zero, np.interp(arguments, (0.0, 0.1, 1.0), (0.0, 0.5, 1.0)), atol=6e-3
    )


def test_levels_are_exceeded_with_the_asked_probability() -> None:
    drawn = np.random.default_rng(4).standard_normal(200_000)
    for share in (0.01, 0.3, 0.5, 0.97):
        level = level_above(np.array([share], np.float32))
        assert np.mean(drawn > level) == pytest.approx(share, abs=5e-3)
    ends = level_above(np.array([0.0, 1.0], np.float32))
    assert ends.tolist() == [UNREACHED, -UNREACHED]
