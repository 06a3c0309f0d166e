"""Islands are dropped exactly as OpenCV drops them."""

import cv2
import numpy as np
import pytest

from digs_warp.sim.sensor.guided.islands import drop_islands


def patches(shape: tuple[int, int], seed: int, cell: int, holes: float) -> np.ndarray:
    """Levels that differ by less or more than a step, with ramps inside, in cells of any form."""
    rng = np.random.default_rng(seed)
    height, width = shape
    coarse = rng.integers(0, 5, (height // cell + 1, width // cell + 1))
    levels = 30 * np.kron(coarse, np.ones((cell, cell), int))[:height, :width]
    values = levels + 10 * np.indices(shape)[1] % 97 + rng.integers(0, 12, shape)
    values[rng.random(shape) < holes] = -16
    return values.astype(np.int16)


@pytest.mark.parametrize(
    "shape", [(1, 1), (1, 100), (100, 1), (7, 31), (20, 32), (33, 33), (64, 200), (180, 321)]
)
@pytest.mark.parametrize("holes", [0.0, 0.05, 0.4, 1.0])
@pytest.mark.parametrize("cell", [1, 4, 30])
def test_they_are_those_of_opencv(shape: tuple[int, int], holes: float, cell: int) -> None:
    image = patches(shape, seed=shape[1] + cell, cell=cell, holes=holes)
    for largest, step in ((20, 0), (3, 12), (100, 32)):
        expected = image.copy()
        cv2.filterSpeckles(expected, -16, largest, step)
        found = image.copy()
        drop_islands(found, -16, largest, step)
        np.testing.assert_array_equal(found, expected)
    if (shape, cell, holes) == ((180, 321), 30, 0.05):  # both kinds
        assert (expected != image).any() and (expected >= 0).any(), "or nothing was tested"


def test_the_largest_differences_do_not_overflow() -> None:
    image = np.full((8, 70), 16383, np.int16)
    image[:, 3::7] = 0
    expected = image.copy()
    cv2.filterSpeckles(expected, -16, 10, 32)
    drop_islands(image, -16, 10, 32)
    np.testing.assert_array_equal(image, expected)
