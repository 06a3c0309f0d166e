"""The edge filter on closed forms: planes, parabolas, steps, holes."""

import numpy as np
import pytest

from digs_warp.init.edges import edge_magnitude, smooth_depth
from reference.init_twin import laplacian_of_pairs, threshold_of

# A plane of about 2 m in float32: 44 weighted differences of values with a step of 1.2e-7 * 2.
PLANE_ROUNDING = 1e-4


def plane(height: int = 24, width: int = 32) -> np.ndarray:
    rows, columns = np.mgrid[:height, :width]
    return (1.0 + 0.013 * columns - 0.021 * rows).astype(np.float32)


def step(height: int = 24, width: int = 32) -> np.ndarray:
    depth = plane(height, width)
    depth[:, width // 2 :] += 1.0
    return depth


# Tiles are 64x16 pixels: none, one, and several of them, whole and cut.
@pytest.mark.parametrize(
    ("shape", "holes"),
    [
        ((1, 1), 0.0),
        ((17, 65), 0.04),
        ((17, 65), 0.999),
        ((40, 130), 0.0),
        ((40, 130), 0.5),
    ],
)
def test_the_kernel_equals_its_twin(shape: tuple[int, int], holes: float) -> None:
    rng = np.random.default_rng(shape[0] + int(1000 * holes))
    depth = rng.uniform(0.5, 2.0, shape).astype(np.float32)
    depth[rng.random(shape) < holes] = np.nan
    magnitude, threshold = edge_magnitude(depth)
    expected = laplacian_of_pairs(depth)
    # Up to 20 differences of 2 m with weights up to 8 in float32, scaled up by at most 4 / 3.
    np.testing.assert_allclose(magnitude, expected, atol=PLANE_ROUNDING)
    np.testing.assert_allclose(threshold, threshold_of(expected), atol=PLANE_ROUNDING, rtol=1e-5)


def test_pixels_within_two_of_a_step_are_dropped_and_the_others_kept() -> None:
    smooth = smooth_depth(step())
    part = (slice(3, 7), slice(10, 20))
    np.testing.assert_array_equal(smooth_depth(step(), part), smooth[part])
    edge_columns = slice(14, 18)  # the step lies between columns 15 and 16
    assert not smooth[:, edge_columns].any()
    assert smooth[2:-2, 2:14].all()
    assert smooth[2:-2, 18:-2].all()
