"""Gaussians <-> the arrays of the USD schema: activation, frames, precision, checks. NumPy only."""

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import linear_from_srgb, srgb_from_linear
from digs_warp.geometry.rigid import quat_multiply, quat_xyzw_from_matrix
from digs_warp.geometry.sh import (
    degree_from_count,
    rgb_from_sh,
    rotate_sh,
    sh_basis,
)
from digs_warp.usd.frames import ASSET_FROM_WORLD, Similarity, similarity_from_matrix

_ASSET_FROM_WORLD = similarity_from_matrix(ASSET_FROM_WORLD, "asset")

# A standard deviation of 0 makes the covariance singular; this one is smaller than any splat [m].
MIN_SCALE = 1e-12

# Opacities between which the logit is finite in float32: the smallest normal number, and the largest
# number below 1.
MIN_OPACITY = float(np.finfo(np.float32).tiny)
MAX_OPACITY = 1.0 - 2.0**-24

# Opacities in a file may be outside 0..1 by this much (rounding); beyond it, they are probably logits.
OPACITY_SLACK = 1e-3

# How the arrays are stored: all in float32, or all but the positions in float16, which halves the file at no
# visible loss.
Precision = Literal["float", "mixed"]

# The smallest positive half: a scale below half of it would become 0.
MIN_HALF_SCALE = 2.0**-24


@dataclass(frozen=True, eq=False)
class SplatArrays:
    """The values of n splats as the schema stores them, in one frame; float32, or float16 to be stored.

    Attributes:
        positions: centers, shape (n, 3).
        orientations: quaternions xyzw, frame-from-local, zero for no rotation, (n, 4).
        scales: standard deviations along the local axes, (n, 3).
        opacities: in 0..1, (n,).
        sh: coefficients, splat after splat, in the order of `digs_warp.geometry.sh`, (n, K, 3).
    """

    positions: np.ndarray
    orientations: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray
    sh: np.ndarray

    def __len__(self) -> int:
        return len(self.positions)

    def floats(self, rows: slice) -> "SplatArrays":
        """Return some of the splats, float32."""
        parts = (getattr(self, each.name)[rows] for each in fields(self))
        return SplatArrays(*(part.astype(np.float32, copy=False) for part in parts))


def asset_arrays(gaussians: Gaussians, precision: Precision) -> SplatArrays:
    """Return Gaussians as they are stored: activated, in the asset's frame, in the chosen precision.

    Raises:
        UsdError: NaN or infinite values, or values beyond the chosen precision.
    """
    arrays = transformed(arrays_from_gaussians(gaussians), _ASSET_FROM_WORLD)
    return arrays if precision == "float" else _with_halves(arrays)


def arrays_from_gaussians(gaussians: Gaussians, what: str = "Gaussians") -> SplatArrays:
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
    check_rows(arrays, what)
    return arrays


def _with_halves(arrays: SplatArrays) -> SplatArrays:
    """Return the splats with all but the positions in float16.

    Scales are kept off the zero that halves below 6e-8 would round to: it makes covariances singular.

    Raises:
        UsdError: a value is beyond the largest half (65504).
    """
    floored = replace(arrays, scales=np.maximum(arrays.scales, np.float32(MIN_HALF_SCALE)))
    stored = {}
    for name in ("orientations", "scales", "opacities", "sh"):
        with np.errstate(over="ignore"):
            stored[name] = getattr(floored, name).astype(np.float16)
        if not is_finite(stored[name]):
            raise UsdError(
                f"Gaussians: {name} beyond 65504 do not fit half precision; write them with precision 'float'"
            )
    return replace(floored, **stored)


def gaussians_from_arrays(arrays: SplatArrays) -> Gaussians:
    """Return raw Gaussians of activated values; scales and opacities are kept off log(0) and logit(1)."""
    opacities = np.clip(arrays.opacities, np.float32(MIN_OPACITY), np.float32(MAX_OPACITY))
    return Gaussians(
        means=arrays.positions,
        log_scales=np.log(np.maximum(arrays.scales, np.float32(MIN_SCALE))),
        quats=arrays.orientations,
        # Exact enough in float32: 1 - p is rounded only below 1/2, by less than 6e-8 of it.
        opacity_logits=np.log(opacities / (1 - opacities)),
        sh=arrays.sh,
    )


def transformed(
    arrays: SplatArrays, b_from_a: Similarity, sh_out: np.ndarray | None = None
) -> SplatArrays:
    """Return the splats of frame a in frame b, with positions, orientations, scales and SH transformed.

    The orientations become unit quaternions with w >= 0. ``sh_out`` takes the coefficients where it is given.
    """
    # Coordinate by coordinate: products with one long side are three times as fast with it last.
    linear = b_from_a.scale * b_from_a.rotation
    positions = linear @ arrays.positions.T.astype(np.float64, order="C")
    positions += b_from_a.translation[:, None]
    return replace(
        arrays,
        positions=positions.T.astype(np.float32, order="C"),
        orientations=_turned_quats(arrays.orientations, b_from_a.rotation),
        scales=arrays.scales * np.float32(b_from_a.scale),
        sh=rotate_sh(arrays.sh, b_from_a.rotation, sh_out),
    )


def _turned_quats(quats: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    # In float64, squares of float32 values neither overflow nor vanish; component by component as above.
    quats = quats.T.astype(np.float64, order="C")
    norm = np.sqrt(np.square(quats).sum(axis=0))
    zero = norm == 0
    quats[3, zero] = 1.0
    norm[zero] = 1.0
    # The product is linear in its second factor: column i of this matrix is its value for unit vector i.
    turned = _quat_products(rotation.tobytes()) @ quats
    turned *= 1.0 / np.copysign(norm, turned[3])
    return turned.T.astype(np.float32, order="C")


@lru_cache(maxsize=16)  # asked again for every piece of the same splats
def _quat_products(rotation: bytes) -> np.ndarray:
    """Return the products of a rotation's quaternion with the four unit quaternions, in columns, (4, 4)."""
    matrix = np.frombuffer(rotation).reshape(3, 3)
    return quat_multiply(quat_xyzw_from_matrix(matrix), np.eye(4)).T.copy()


# Directions, evenly spread, at which linear colors are looked at.
_DIRECTIONS = 64


def srgb_coefficients(sh: np.ndarray) -> np.ndarray:
    """Return coefficients, (n, K, 3), float32, in sRGB of linear colors of Rec.709.

    Exact for colors that are the same from all sides; for others, the nearest over all directions.
    """
    turn = np.arange(_DIRECTIONS) + 0.5
    height = 1 - 2 * turn / _DIRECTIONS
    angle, radius = turn * (np.pi * (3 - np.sqrt(5))), np.sqrt(1 - height**2)
    directions = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    basis = sh_basis(directions, degree_from_count(sh.shape[1]))
    colors = srgb_from_linear(np.maximum(0.5 + basis @ sh.astype(np.float64), 0.0))
    return (np.linalg.pinv(basis) @ (colors - 0.5)).astype(np.float32)


def check_rows(arrays: SplatArrays, what: str) -> None:
    """Raise a `UsdError` with the number of splats that hold NaN or infinite values."""
    fields = [getattr(arrays, name) for name in SplatArrays.__dataclass_fields__]
    if all(map(is_finite, fields)):
        return
    bad = np.zeros(len(arrays), dtype=bool)
    for field in fields:
        bad |= ~np.isfinite(field).reshape(len(arrays), -1).all(axis=1)
    raise UsdError(
        f"{what}: {np.count_nonzero(bad)} of {len(arrays)} splats hold NaN or infinite values "
        f"(the first is number {np.argmax(bad)}); remove them or train again"
    )


def is_finite(values: np.ndarray) -> bool:
    """Whether no value is NaN or infinite; faster than np.isfinite if there are none."""
    with np.errstate(over="ignore", invalid="ignore"):
        # NaN and infinity survive a sum. Finite values whose sum overflows are checked one by one.
        if values.dtype == np.float32 and values.flags.c_contiguous:
            flat = values.reshape(-1)
            total = np.dot(flat, flat)  # of squares, because that is quicker than a plain sum
        else:
            total = values.sum(dtype=np.float32 if values.dtype == np.float16 else None)
    return bool(np.isfinite(total) or np.isfinite(values).all())


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


def display_color(arrays: SplatArrays) -> np.ndarray:
    """Return the opacity-weighted mean color of at least one splat, linear RGB in 0..1, shape (3,)."""
    weights = arrays.opacities.astype(np.float64) + MIN_OPACITY
    # No matrix product: its rounding depends on the number of threads.
    mean_sh = (weights[:, None] * arrays.sh[:, 0]).sum(axis=0) / weights.sum()
    # Degree 0 has the same color in all directions.
    srgb = rgb_from_sh(mean_sh[None, None], np.array([[0.0, 0.0, 1.0]]))[0]
    return linear_from_srgb(np.clip(srgb, 0.0, 1.0))
