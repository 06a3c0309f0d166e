"""Gaussians <-> the arrays of the USD schema: activation, frames, checks, extent. NumPy only."""

from dataclasses import dataclass, replace

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.gaussians import Gaussians
from digs_warp.geometry import matrix_from_quat_xyzw, quat_multiply, quat_xyzw_from_matrix
from digs_warp.images import linear_from_srgb
from digs_warp.sh import rgb_from_sh, rotate_sh
from usd.frames import Similarity

# A standard deviation of 0 makes the covariance singular; this one is smaller than any splat [m].
MIN_SCALE = 1e-12

# Opacities between which the logit is finite in float32: the smallest normal number, and the largest
# number below 1.
MIN_OPACITY = float(np.finfo(np.float32).tiny)
MAX_OPACITY = 1.0 - 2.0**-24

# Opacities read from a file may leave 0..1 by this much (rounding) before they are taken for logits.
OPACITY_SLACK = 1e-3

# Rows handled at a time where many intermediate arrays are needed: they stay in the cache.
CHUNK = 16384


@dataclass(frozen=True, eq=False)
class SplatArrays:
    """The values of n splats as the schema stores them, in one frame, float32.

    Attributes:
        positions: centres, shape (n, 3).
        orientations: quaternions xyzw, frame-from-local, zero for no rotation, (n, 4).
        scales: standard deviations along the local axes, (n, 3).
        opacities: in 0..1, (n,).
        sh: coefficients, splat after splat, in the order of `digs_warp.sh`, (n, K, 3).
    """

    positions: np.ndarray
    orientations: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray
    sh: np.ndarray

    def __len__(self) -> int:
        return len(self.positions)


def arrays_from_gaussians(gaussians: Gaussians) -> SplatArrays:
    """Return the activated values of ``gaussians``, in their own frame.

    Raises:
        UsdError: rows hold NaN or infinite values (also after activation); says how many.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # reported below, by splat
        arrays = SplatArrays(
            gaussians.means,
            gaussians.quats,
            np.maximum(gaussians.scales, np.float32(MIN_SCALE)),
            np.clip(gaussians.opacities, 0.0, 1.0),
            gaussians.sh,
        )
    check_rows(arrays, "Gaussians")
    return arrays


def gaussians_from_arrays(arrays: SplatArrays) -> Gaussians:
    """Return raw Gaussians of activated values; scales and opacities are kept off log(0) and logit(1)."""
    opacities = np.clip(arrays.opacities.astype(np.float64), MIN_OPACITY, MAX_OPACITY)
    return Gaussians(
        means=arrays.positions,
        log_scales=np.log(np.maximum(arrays.scales, np.float32(MIN_SCALE))),
        quats=arrays.orientations,
        opacity_logits=np.log(opacities) - np.log1p(-opacities),
        sh=arrays.sh,
    )


def transformed(arrays: SplatArrays, b_from_a: Similarity) -> SplatArrays:
    """Return the splats of frame a in frame b: positions, orientations, scales and SH all turned.

    The orientations become unit quaternions with w >= 0.
    """
    linear = b_from_a.scale * b_from_a.rotation
    return replace(
        arrays,
        positions=(arrays.positions @ linear.T + b_from_a.translation).astype(np.float32),
        orientations=_turned_quats(arrays.orientations, b_from_a.rotation),
        scales=arrays.scales * np.float32(b_from_a.scale),
        sh=rotate_sh(arrays.sh, b_from_a.rotation),
    )


def _turned_quats(quats: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    quats = quats.astype(np.float64)  # squares of float32 values neither overflow nor vanish
    norm = np.sqrt(np.einsum("ni,ni->n", quats, quats))
    quats[norm == 0] = (0.0, 0.0, 0.0, 1.0)
    norm[norm == 0] = 1.0
    # The product is linear in its second factor: row i of this matrix is its value for unit vector i.
    turned = quats @ quat_multiply(quat_xyzw_from_matrix(rotation), np.eye(4))
    turned /= np.copysign(norm, turned[:, 3])[:, None]
    return turned.astype(np.float32)


def check_rows(arrays: SplatArrays, what: str) -> None:
    """Raise a `UsdError` with the number of splats that hold NaN or infinite values."""
    fields = [getattr(arrays, name) for name in SplatArrays.__dataclass_fields__]
    if all(np.isfinite(field).all() for field in fields):
        return
    bad = np.zeros(len(arrays), dtype=bool)
    for field in fields:
        bad |= ~np.isfinite(field).reshape(len(arrays), -1).all(axis=1)
    raise UsdError(
        f"{what}: {np.count_nonzero(bad)} of {len(arrays)} splats hold NaN or infinite values "
        f"(the first is number {np.argmax(bad)}); remove them or train again"
    )


def check_activated(arrays: SplatArrays, what: str) -> None:
    """Raise a `UsdError` when scales look like logarithms or opacities like logits."""
    if len(arrays) == 0:
        return
    smallest = arrays.scales.min()
    if smallest < 0:
        raise UsdError(
            f"{what}: scales as low as {smallest:.3g}, expected linear standard deviations of 0 "
            "or more; the file seems to hold logarithms. Export it again with activated scales."
        )
    low, high = arrays.opacities.min(), arrays.opacities.max()
    if low < -OPACITY_SLACK or high > 1 + OPACITY_SLACK:
        raise UsdError(
            f"{what}: opacities from {low:.3g} to {high:.3g}, expected 0 to 1; "
            "the file seems to hold logits. Export it again with activated opacities."
        )


def three_sigma_extent(arrays: SplatArrays) -> np.ndarray:
    """Return the corners (minimum, maximum), float32 (2, 3), of the box around every 3-sigma ellipsoid.

    The ellipsoid of covariance ``R S^2 R^T`` reaches ``3 sqrt(diag(R S^2 R^T))`` along the axes. The box
    of no splats is USD's empty one (minimum above maximum).
    """
    largest = float(np.finfo(np.float32).max)
    low, high = np.full(3, largest), np.full(3, -largest)
    if len(arrays) == 0:
        return np.stack([low, high]).astype(np.float32)
    for first in range(0, len(arrays), CHUNK):
        rows = slice(first, first + CHUNK)
        # float64: rounding must not push an ellipsoid out of its box.
        axes = matrix_from_quat_xyzw(arrays.orientations[rows])
        axes *= arrays.scales[rows, None, :]
        # One row per axis: minima over long rows are five times as fast as over three columns.
        reach = 3.0 * np.sqrt(np.einsum("nij,nij->in", axes, axes))
        centers = np.ascontiguousarray(arrays.positions[rows].T)
        low = np.minimum(low, (centers - reach).min(axis=1))
        high = np.maximum(high, (centers + reach).max(axis=1))
    # Rounded outwards.
    box = np.stack([low, high]).astype(np.float32)
    return np.nextafter(box, np.array([[-np.inf], [np.inf]], dtype=np.float32))


def mean_display_color(arrays: SplatArrays) -> np.ndarray:
    """Return the opacity-weighted mean colour of at least one splat, linear RGB in 0..1, shape (3,)."""
    weights = arrays.opacities + np.float32(MIN_OPACITY)
    mean_sh = weights @ arrays.sh[:, 0] / weights.sum()
    # A field of degree 0 looks the same from everywhere: any direction will do.
    srgb = rgb_from_sh(mean_sh[None, None], np.array([[0.0, 0.0, 1.0]]))[0]
    return linear_from_srgb(np.clip(srgb, 0.0, 1.0))
