"""Rules for fields of splats, their values at one time, and whole stages.

The schema itself allows nearly everything: these are the mistakes that exporters make, and the limits of
importers (degree 0 to 3, unit quaternions to 1e-3, as in NVIDIA's rule VG.035).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import PurePosixPath, PureWindowsPath
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import doubts_of
from digs_warp.geometry.sh import MAX_DEGREE
from digs_warp.usd import names
from digs_warp.usd.author import three_sigma_extent
from digs_warp.usd.convert import SplatArrays, is_finite
from digs_warp.usd.field import array_of, color_space, extent_of, find_fields
from digs_warp.usd.findings import Finding
from digs_warp.usd.frames import similarity_from_matrix
from digs_warp.words import quoted

if TYPE_CHECKING:
    from pxr import Usd

_T = TypeVar("_T")

QUAT_TOLERANCE = 1e-3
# The box may exceed the splats' own by this share of its diagonal before viewers frame the scene badly.
MAX_SLACK = 0.5
# Rounding of a box computed elsewhere in float32, as a share of the diagonal.
EXTENT_TOLERANCE = 1e-5
_HINTS = {
    names.PROJECTION_HINT: ("perspective", "tangential"),
    names.SORTING_HINT: ("zDepth", "cameraDistance", "rayHitDistance"),
}


def check_field(prim: "Usd.Prim") -> Iterator[Finding]:
    """Yield what is wrong with a field; of an animated one, with its first sample."""
    where = str(prim.GetPath())
    try:
        found = [*check_values(_values(prim))]
    except UsdError as error:
        found = [Finding("attribute-type", "error", str(error))]
    for finding in (
        *found,
        *_check_hints(prim),
        *_check_color_space(prim),
        *_check_transform(prim),
    ):
        yield replace(finding, where=where)


def check_stage(stage: "Usd.Stage") -> Iterator[Finding]:
    """Yield what is wrong with a scene as a whole."""
    fields = [str(prim.GetPath()) for prim in find_fields(stage)]
    if not fields:
        yield Finding("one-field", "error", "no field of splats in the scene")
    elif len(fields) > 1:
        message = (
            f"{len(fields)} fields of splats ({', '.join(fields)}); some importers refuse that, or "
            "take the first"
        )
        yield Finding("one-field", "warning", message)
    for layer in stage.GetUsedLayers():
        for asset in sorted(layer.GetExternalReferences()):
            if _leaves_the_scene(asset):
                message = f"refers to '{asset}', expected a relative path below the scene"
                yield Finding("asset-path", "error", message, layer.GetDisplayName())


@dataclass(frozen=True, eq=False)
class FieldValues:
    """The authored values of a field as they are; None where nothing is authored.

    Attributes:
        arrays: those of `names.WIDTHS`: rows, quaternions xyzw, sh (m, 3).
        degree: of the spherical harmonics.
        element_size, interpolation: metadata of the coefficients.
        extent: (2, 3).
    """

    arrays: dict[str, np.ndarray | None]
    degree: int | None
    element_size: int | None
    interpolation: str | None
    extent: np.ndarray | None

    def of_each(self, name: str, count: int) -> np.ndarray | None:
        """Return an array if it has one row for each splat."""
        array = self.arrays[name]
        return array if array is not None and len(array) == count else None


def _values(prim: "Usd.Prim") -> FieldValues:
    coefficients = prim.GetAttribute(names.SH_COEFFICIENTS)
    if not (coefficients and coefficients.HasAuthoredValue()):
        half = prim.GetAttribute(names.SH_COEFFICIENTS + names.HALF_SUFFIX)
        coefficients = half or coefficients
    return FieldValues(
        arrays={name: array_of(prim, name) for name in names.WIDTHS},
        degree=_degree(prim),
        element_size=_metadata(coefficients, "elementSize", int),
        interpolation=_metadata(coefficients, "interpolation", str),
        extent=extent_of(prim),
    )


def _degree(prim: "Usd.Prim") -> int | None:
    attribute = prim.GetAttribute(names.SH_DEGREE)
    value = attribute.Get() if attribute and attribute.HasAuthoredValue() else None
    return value if isinstance(value, int) else None


def _metadata(attribute: "Usd.Attribute", name: str, kind: type[_T]) -> _T | None:
    value = attribute.GetMetadata(name) if attribute else None
    return value if isinstance(value, kind) else None


def _check_hints(prim: "Usd.Prim") -> Iterator[Finding]:
    for name, allowed in _HINTS.items():
        attribute = prim.GetAttribute(name)
        if not (attribute and attribute.HasAuthoredValue()):
            message = f"'{name}' is not authored; renderers will take '{allowed[0]}'"
            yield Finding("hints", "warning", message)
        elif attribute.Get() not in allowed:
            message = f"'{name}' is '{attribute.Get()}', expected one of {', '.join(allowed)}"
            yield Finding("hints", "error", message)


def _check_color_space(prim: "Usd.Prim") -> Iterator[Finding]:
    name, space = color_space(prim)
    if not name:
        message = "no color space is authored; sRGB and linear colors cannot be told apart"
        yield Finding("color-space", "warning", message)
    elif space is None:
        message = f"color space {quoted(name)} is neither OpenUSD's nor defined in the scene"
        yield Finding("color-space", "error", message)


def _check_transform(prim: "Usd.Prim") -> Iterator[Finding]:
    from pxr import Usd, UsdGeom

    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    matrix = np.array(cache.GetLocalToWorldTransform(prim)).T
    try:
        similarity = similarity_from_matrix(matrix, "the field")
    except UsdError as error:
        yield Finding("transform", "error", str(error))
        return
    if np.abs(similarity.rotation - np.eye(3)).max() > 1e-6:
        message = (
            "the field is rotated by a transform; renderers differ on whether colors turn along"
        )
        yield Finding("transform", "warning", message)


def _leaves_the_scene(asset: str) -> bool:
    return (
        PurePosixPath(asset).is_absolute()
        or PureWindowsPath(asset).is_absolute()
        or ".." in PurePosixPath(asset.replace("\\", "/")).parts
        or "://" in asset
    )


def check_values(values: FieldValues) -> Iterator[Finding]:
    """Yield what is wrong with the values; ``where`` is left to the caller."""
    positions = values.arrays[names.POSITIONS]
    if positions is None or len(positions) == 0:
        yield Finding("splat-count", "warning", "no splats: positions are empty or not authored")
        return
    count = len(positions)
    for name, array in values.arrays.items():
        if name == names.SH_COEFFICIENTS:
            continue
        if array is None:
            yield Finding("splat-count", "error", f"'{name}' is not authored")
        elif len(array) != count:
            yield Finding(
                "splat-count",
                "error",
                f"{len(array)} values in '{name}', expected {count}, one per splat",
            )
    finite = yield from _check_finite(values.arrays)
    yield from _check_harmonics(values, count)
    if not finite:
        return  # comparisons with NaN would only add noise
    yield from _check_ranges(values)
    scales, quats = (values.of_each(name, count) for name in (names.SCALES, names.ORIENTATIONS))
    if values.extent is None:
        yield Finding("extent", "error", "'extent' is not authored; viewers cannot frame the scene")
    if scales is not None and quats is not None:
        yield from _check_plausible(values, positions, scales)
        if values.extent is not None:
            yield from _check_extent(positions, quats, scales, values.extent)


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
    sh = values.arrays[names.SH_COEFFICIENTS]
    if sh is None:
        yield Finding("sh-count", "error", "no coefficients: every splat is gray")
        return
    per_splat = (degree + 1) ** 2
    if len(sh) != count * per_splat:
        yield Finding(
            "sh-count",
            "error",
            f"{len(sh)} coefficients, expected {count} x {per_splat} for degree {degree}",
        )
    if values.element_size != per_splat:
        found = "not authored" if values.element_size is None else str(values.element_size)
        yield Finding("sh-metadata", "error", f"elementSize is {found}, expected {per_splat}")
    if values.interpolation != "vertex":
        found = values.interpolation or "not authored"
        yield Finding("sh-metadata", "error", f"interpolation is {found}, expected 'vertex'")


def _check_ranges(values: FieldValues) -> Iterator[Finding]:
    named = (names.OPACITIES, names.SCALES, names.ORIENTATIONS)
    opacities, scales, quats = (values.arrays[name] for name in named)
    if opacities is not None and len(opacities):
        low, high = opacities.min(), opacities.max()
        if low < 0 or high > 1:
            yield Finding(
                "opacity-range",
                "error",
                f"opacities from {low:.3g} to {high:.3g}, expected 0 to 1; are these logits?",
            )
    if scales is not None and len(scales):
        smallest = scales.min()
        if smallest < 0:
            message = f"scales down to {smallest:.3g}, expected above 0; are these logarithms?"
            yield Finding("scale-range", "error", message)
        elif smallest == 0:
            zeros = np.count_nonzero((scales == 0).any(axis=1))
            lost = " (below 6e-8 a half becomes 0)" if scales.dtype == np.float16 else ""
            message = f"{zeros} splats with a scale of 0, expected above 0{lost}"
            yield Finding("scale-range", "error", message)
    if quats is not None and len(quats):
        quats = quats.astype(np.float32, copy=False)
        error = np.abs(np.sqrt(np.einsum("ni,ni->n", quats, quats)) - 1)
        if error.max() > QUAT_TOLERANCE:
            bad = np.count_nonzero(error > QUAT_TOLERANCE)
            message = f"{bad} quaternions are not of length 1 (off by up to {error.max():.3g})"
            yield Finding("quaternion-length", "error", message)


def _check_plausible(
    values: FieldValues, positions: np.ndarray, scales: np.ndarray
) -> Iterator[Finding]:
    """Yield what looks like the mistake of a program."""
    count = len(positions)
    opacities, base = values.of_each(names.OPACITIES, count), values.arrays[names.SH_COEFFICIENTS]
    if opacities is None:
        opacities = np.ones(count, np.float32)
    if base is not None:
        base = base[:: max(values.element_size or 1, 1)]
    if base is None or len(base) != count:
        base = np.zeros((count, 3), np.float32)
    for rule, message in doubts_of(positions, scales, opacities, base):
        yield Finding(rule, "warning", message)


def _check_extent(
    positions: np.ndarray, quats: np.ndarray, scales: np.ndarray, extent: np.ndarray
) -> Iterator[Finding]:
    if not np.isfinite(extent).all():
        yield Finding("extent", "error", "'extent' is NaN or infinite")
        return
    nothing = np.empty(0, dtype=np.float32)
    splats = SplatArrays(positions, quats, scales, nothing, nothing)
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
