"""Rules for the values of one field of splats at one time, in NumPy; the rest: `digs_warp.usd.field_rules`.

The schema itself allows nearly everything: these are the mistakes that exporters make, and the limits of
importers (degree 0 to 3, unit quaternions to 1e-3, as in NVIDIA's rule VG.035).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from digs_warp.data.gaussians import doubts_of
from digs_warp.geometry.sh import MAX_DEGREE
from digs_warp.usd import names
from digs_warp.usd.author import three_sigma_extent
from digs_warp.usd.convert import SplatArrays, is_finite
from digs_warp.usd.findings import Finding

QUAT_TOLERANCE = 1e-3
# The box may exceed the splats' own by this share of its diagonal before viewers frame the scene badly.
MAX_SLACK = 0.5
# Rounding of a box computed elsewhere in float32, as a share of the diagonal.
EXTENT_TOLERANCE = 1e-5


@dataclass(frozen=True, eq=False)
class FieldValues:
    """The authored values of a field as they are; None where nothing is authored.

    Attributes:
        positions, orientations, scales, opacities, sh: arrays of rows, quaternions xyzw, sh (m, 3).
        degree: of the spherical harmonics.
        element_size, interpolation: metadata of the coefficients.
        extent: (2, 3).
    """

    positions: np.ndarray | None
    orientations: np.ndarray | None
    scales: np.ndarray | None
    opacities: np.ndarray | None
    sh: np.ndarray | None
    degree: int | None
    element_size: int | None
    interpolation: str | None
    extent: np.ndarray | None


def check_values(values: FieldValues) -> Iterator[Finding]:
    """Yield what is wrong with the values; ``where`` is left to the caller."""
    if values.positions is None or len(values.positions) == 0:
        yield Finding("splat-count", "warning", "no splats: positions are empty or not authored")
        return
    count = len(values.positions)
    arrays = {
        names.POSITIONS: values.positions,
        names.ORIENTATIONS: values.orientations,
        names.SCALES: values.scales,
        names.OPACITIES: values.opacities,
    }
    for name, array in arrays.items():
        if array is None:
            yield Finding("splat-count", "error", f"'{name}' is not authored")
        elif len(array) != count:
            yield Finding(
                "splat-count",
                "error",
                f"{len(array)} values in '{name}', expected {count}, one per splat",
            )
    finite = yield from _check_finite(arrays | {names.SH_COEFFICIENTS: values.sh})
    yield from _check_harmonics(values, count)
    if not finite:
        return  # comparisons with NaN would only add noise
    yield from _check_ranges(values)
    if _is_complete(values, count):
        yield from _check_plausible(values)
    if values.extent is None:
        yield Finding("extent", "error", "'extent' is not authored; viewers cannot frame the scene")
    elif _is_complete(values, count):
        yield from _check_extent(values, values.extent)


def _check_finite(arrays: dict[str, np.ndarray | None]) -> Iterator[Finding]:
    finite = True
    for name, array in arrays.items():
        if array is not None and not is_finite(array):
            finite = False
            bad = np.count_nonzero(~np.isfinite(array))
            yield Finding("finite", "error", f"{bad} NaN or infinite values in '{name}'")
    return finite


def _check_harmonics(values: FieldValues, count: int) -> Iterator[Finding]:
    if values.degree is None:
        yield Finding("sh-degree", "warning", "the degree is not authored; readers take it for 3")
    degree = names.FALLBACK_DEGREE if values.degree is None else values.degree
    if not 0 <= degree <= MAX_DEGREE:
        yield Finding("sh-degree", "error", f"degree {degree}, expected 0 to {MAX_DEGREE}")
        return
    if values.sh is None:
        yield Finding("sh-count", "error", "no coefficients: every splat is gray")
        return
    per_splat = (degree + 1) ** 2
    if len(values.sh) != count * per_splat:
        yield Finding(
            "sh-count",
            "error",
            f"{len(values.sh)} coefficients, expected {count} x {per_splat} for degree {degree}",
        )
    if values.element_size != per_splat:
        found = "not authored" if values.element_size is None else str(values.element_size)
        yield Finding("sh-metadata", "error", f"elementSize is {found}, expected {per_splat}")
    if values.interpolation != "vertex":
        found = values.interpolation or "not authored"
        yield Finding("sh-metadata", "error", f"interpolation is {found}, expected 'vertex'")


def _check_ranges(values: FieldValues) -> Iterator[Finding]:
    if values.opacities is not None and len(values.opacities):
        low, high = values.opacities.min(), values.opacities.max()
        if low < 0 or high > 1:
            yield Finding(
                "opacity-range",
                "error",
                f"opacities from {low:.3g} to {high:.3g}, expected 0 to 1; are these logits?",
            )
    if values.scales is not None and len(values.scales):
        smallest = values.scales.min()
        if smallest < 0:
            message = f"scales down to {smallest:.3g}, expected above 0; are these logarithms?"
            yield Finding("scale-range", "error", message)
        elif smallest == 0:
            zeros = np.count_nonzero((values.scales == 0).any(axis=1))
            lost = " (below 6e-8 a half becomes 0)" if values.scales.dtype == np.float16 else ""
            message = f"{zeros} splats with a scale of 0, expected above 0{lost}"
            yield Finding("scale-range", "error", message)
    if values.orientations is not None and len(values.orientations):
        quats = values.orientations.astype(np.float32, copy=False)
        error = np.abs(np.sqrt(np.einsum("ni,ni->n", quats, quats)) - 1)
        if error.max() > QUAT_TOLERANCE:
            bad = np.count_nonzero(error > QUAT_TOLERANCE)
            message = f"{bad} quaternions are not of length 1 (off by up to {error.max():.3g})"
            yield Finding("quaternion-length", "error", message)


def _check_plausible(values: FieldValues) -> Iterator[Finding]:
    """Yield what looks like the mistake of a program; needs as many values as splats."""
    assert values.positions is not None and values.scales is not None
    count = len(values.positions)
    opacities, base = np.ones(count, np.float32), np.zeros((count, 3), np.float32)
    if values.opacities is not None and len(values.opacities) == count:
        opacities = values.opacities
    if (
        values.sh is not None
        and len(found := values.sh[:: max(values.element_size or 1, 1)]) == count
    ):
        base = found
    for rule, message in doubts_of(values.positions, values.scales, opacities, base):
        yield Finding(rule, "warning", message)


def _is_complete(values: FieldValues, count: int) -> bool:
    arrays = (values.orientations, values.scales)
    return all(array is not None and len(array) == count for array in arrays)


def _check_extent(values: FieldValues, extent: np.ndarray) -> Iterator[Finding]:
    assert values.positions is not None and values.orientations is not None
    assert values.scales is not None
    if not np.isfinite(extent).all():
        yield Finding("extent", "error", "'extent' is NaN or infinite")
        return
    nothing = np.empty(0, dtype=np.float32)
    splats = SplatArrays(values.positions, values.orientations, values.scales, nothing, nothing)
    low, high = three_sigma_extent(splats).astype(np.float64)
    diagonal = float(np.linalg.norm(high - low))
    missing = max(float((extent[0] - low).max()), float((high - extent[1]).max()))
    if missing > EXTENT_TOLERANCE * diagonal:
        yield Finding(
            "extent",
            "error",
            f"'extent' cuts off splats by up to {missing:.3g}: it has to hold every 3-sigma ellipsoid, "
            "not only the centers",
        )
    if float(np.linalg.norm(extent[1] - extent[0])) > (1 + MAX_SLACK) * diagonal:
        yield Finding("extent", "warning", "'extent' is much larger than the splats")
