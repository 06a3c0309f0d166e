from itertools import product
from math import factorial

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
from scipy.special import lpmv

from digs_warp.geometry.sh import (
    C0,
    coefficient_count,
    rgb_from_sh,
    rotate_sh,
    sh_basis,
)


def random_directions(count: int, seed: int = 0) -> np.ndarray:
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def random_rotation(seed: int) -> np.ndarray:
    return Rotation.from_quat(np.random.default_rng(seed).normal(size=4)).as_matrix()


def basis_from_legendre(directions: np.ndarray, degree: int) -> np.ndarray:
    """Real spherical harmonics by their definition; `lpmv` holds the Condon-Shortley sign."""
    z = directions[:, 2]
    azimuth = np.arctan2(directions[:, 1], directions[:, 0])
    columns = []
    for band in range(degree + 1):
        for m in range(-band, band + 1):
            order = abs(m)
            norm = (2 * band + 1) / (4 * np.pi) * factorial(band - order) / factorial(band + order)
            wave = np.sin(order * azimuth) if m < 0 else np.cos(order * azimuth)
            scale = np.sqrt(norm) * (np.sqrt(2) if m else 1.0)
            columns.append(scale * lpmv(order, band, z) * wave)
    return np.stack(columns, axis=1)


def test_basis_is_that_of_the_legendre_functions_order_and_signs_included():
    directions = random_directions(100)
    for degree in range(4):
        basis = sh_basis(directions, degree)
        assert basis.shape == (100, coefficient_count(degree))
        assert_allclose(basis, basis_from_legendre(directions, degree), atol=1e-12)
    negative = np.array([[[-1.0, 0.0, 1.0]]]) / C0  # colors are clipped at 0 only
    assert_allclose(rgb_from_sh(negative, directions[:1]), [[0.0, 0.5, 1.5]])


def test_turned_field_shows_along_the_turned_direction_what_it_showed_before():
    for degree, seed in product(range(4), range(5)):
        sh = np.random.default_rng(1).normal(size=(40, coefficient_count(degree), 3))
        rotation = random_rotation(seed)
        directions = random_directions(40, seed)
        assert_allclose(
            rgb_from_sh(rotate_sh(sh, rotation), directions @ rotation.T),
            rgb_from_sh(sh, directions),
            atol=1e-12,
        )


def test_a_quarter_turn_swaps_coefficients_of_bands_0_and_1_exactly():
    sh = np.random.default_rng(4).normal(size=(10, 4, 3)).astype(np.float32)
    sh[0, 2] = 0.0  # stays 0: no rounding noise of its neighbors may show
    y_up = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    assert_array_equal(rotate_sh(rotate_sh(sh, y_up), y_up.T), sh)
    # Band 1 is (-y, z, -x): the new y is the old z, the new z is the old -y.
    turned = rotate_sh(sh, y_up)
    assert_array_equal(turned[:, [0, 3]], sh[:, [0, 3]])
    assert_array_equal(turned[:, 1], -sh[:, 2])
    assert_array_equal(turned[:, 2], sh[:, 1])
