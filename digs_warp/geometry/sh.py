"""Real spherical harmonics as 3D Gaussian splatting and USD use them (degrees 0 to 3), in NumPy.

Coefficients have shape (..., K, 3) with K = (degree + 1)^2: band l ascending, m = -l..l inside a band,
one RGB triplet each. Color = 0.5 + sum of coefficient * basis(direction), direction from the camera
to the splat. The constants and signs are those of the 3DGS PLY and the USD reference renderer
(Condon-Shortley: band 1 is (-y, z, -x)). The Warp twin lives in `digs_warp.splat.project`.
"""

from functools import lru_cache

import numpy as np

from digs_warp.checks import DigsError

MAX_DEGREE = 3

# Enough for matte surfaces.
USUAL_DEGREE = 1

C0 = 0.28209479177387814
C1 = 0.4886025119029199
C2 = (
    1.0925484305920792,
    -1.0925484305920792,
    0.31539156525252005,
    -1.0925484305920792,
    0.5462742152960396,
)
C3 = (
    -0.5900435899266435,
    2.890611442640554,
    -0.4570457994644658,
    0.3731763325901154,
    -0.4570457994644658,
    1.445305721320277,
    -0.5900435899266435,
)


def coefficient_count(degree: int) -> int:
    """Return K, the number of coefficients a color channel of ``degree`` (0..3) has."""
    if degree not in range(MAX_DEGREE + 1):
        raise DigsError(f"spherical harmonics degree {degree}, expected 0 to {MAX_DEGREE}")
    return (degree + 1) ** 2


def degree_from_count(count: int) -> int:
    """Return the degree of K = 1, 4, 9 or 16 coefficients."""
    for degree in range(MAX_DEGREE + 1):
        if coefficient_count(degree) == count:
            return degree
    raise DigsError(f"{count} spherical harmonics coefficients, expected 1, 4, 9 or 16")


def sh_basis(directions: np.ndarray, degree: int) -> np.ndarray:
    """Return the basis values, shape (..., K), of unit vectors, shape (..., 3)."""
    coefficient_count(degree)
    x, y, z = np.moveaxis(np.asarray(directions, np.result_type(directions, np.float64)), -1, 0)
    xx, yy, zz = x * x, y * y, z * z
    basis = [np.full_like(x, C0)]
    if degree >= 1:
        basis += [-C1 * y, C1 * z, -C1 * x]
    if degree >= 2:
        basis += [C2[0] * x * y, C2[1] * y * z, C2[2] * (2 * zz - xx - yy)]
        basis += [C2[3] * x * z, C2[4] * (xx - yy)]
    if degree >= 3:
        basis += [C3[0] * y * (3 * xx - yy), C3[1] * x * y * z, C3[2] * y * (4 * zz - xx - yy)]
        basis += [C3[3] * z * (2 * zz - 3 * xx - 3 * yy), C3[4] * x * (4 * zz - xx - yy)]
        basis += [C3[5] * z * (xx - yy), C3[6] * x * (xx - 3 * yy)]
    return np.stack(basis, axis=-1)


def rgb_from_sh(sh: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return colors clipped at 0 below, shape (n, 3), of ``sh`` (n, K, 3) seen along unit vectors (n, 3)."""
    basis = sh_basis(directions, degree_from_count(sh.shape[-2]))
    return np.maximum(0.0, 0.5 + np.einsum("nk,nkc->nc", basis, sh))


def sh_from_rgb(rgb: np.ndarray) -> np.ndarray:
    """Return the DC coefficient that shows ``rgb`` (0..1) from every side."""
    return (np.asarray(rgb, dtype=np.float64) - 0.5) / C0


def sh_rotation(rotation: np.ndarray, degree: int) -> np.ndarray:
    """Return the (K, K) matrix that turns the coefficients of a field with ``rotation`` (3, 3).

    Each band mixes only with itself, so the matrix is block-diagonal; a block is solved from 64
    directions, exact to rounding.
    """
    return _solved_rotation(np.asarray(rotation, dtype=np.float64).tobytes(), degree).copy()


@lru_cache(maxsize=16)  # those who turn splats piece by piece ask again for every piece
def _solved_rotation(rotation: bytes, degree: int) -> np.ndarray:
    directions = np.random.default_rng(0).normal(size=(64, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before = sh_basis(directions, degree)
    after = sh_basis(directions @ np.frombuffer(rotation).reshape(3, 3).T, degree)
    mix = np.eye(coefficient_count(degree))
    for band in range(1, degree + 1):
        own = slice(band**2, (band + 1) ** 2)
        mix[own, own] = np.linalg.lstsq(after[:, own], before[:, own], rcond=None)[0]
    mix[np.abs(mix) < 1e-12] = 0.0  # rounding noise: without it quarter turns are not exact
    return mix


def rotate_sh(sh: np.ndarray, rotation: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
    """Return the coefficients of the field turned by ``rotation`` (3, 3), in the number type of ``sh``.

    The turned field shows along ``rotation @ d`` what ``sh`` (n, K, 3) showed along ``d``. Integers
    give float64. ``out``, in one piece, takes the result where it is given.
    """
    sh = np.asarray(sh)
    kind = sh.dtype if sh.dtype.kind == "f" else np.dtype(np.float64)
    # One product with a (3K, 3K) matrix, two thirds of it zeros, is three times as fast as a product
    # per band: it reads and writes the coefficients once.
    mix = np.kron(sh_rotation(rotation, degree_from_count(sh.shape[-2])), np.eye(3))
    rows = sh.reshape(-1, mix.shape[0]).astype(kind, copy=False)
    if out is not None:
        assert out.flags.c_contiguous  # else the next line makes a copy
        out = out.reshape(rows.shape)
    return np.matmul(rows, mix.T.astype(kind), out=out).reshape(sh.shape)
