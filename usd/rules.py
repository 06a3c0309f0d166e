"""Rules for fields of splats and whole stages.

The schema itself allows nearly everything: these are the mistakes that exporters make, and the limits of
importers (degree 0 to 3, unit quaternions to 1e-3, as in NVIDIA's rule VG.035).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import PurePosixPath, PureWindowsPath
from typing import TYPE_CHECKING, Literal

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import doubts_of
from digs_warp.geometry.sh import MAX_DEGREE
from digs_warp.usd import names
from digs_warp.usd.author import three_sigma_extent
from digs_warp.usd.convert import SplatArrays, is_finite
from digs_warp.usd.field import array_of, color_space, extent_of, find_fields, stored
from digs_warp.usd.frames import similarity_from_matrix
from digs_warp.words import quoted

if TYPE_CHECKING:
    from pxr import Usd

QUAT_TOLERANCE = 1e-3
# The box may exceed the splats' own by this share of its diagonal before viewers frame the scene badly.
MAX_SLACK = 0.5
# Rounding of a box computed elsewhere in float32, as a share of the diagonal.
EXTENT_TOLERANCE = 1e-5
_HINTS = {
    names.PROJECTION_HINT: ("perspective", "tangential"),
    names.SORTING_HINT: ("zDepth", "cameraDistance", "rayHitDistance"),
}


@dataclass(frozen=True)
class Finding:
    """A problem of a scene.

    Attributes:
        rule: name of the rule that found it.
        severity: errors break a reader or a renderer; warnings are probably not intended.
        message: what was found, what was expected.
        where: path of the prim, or name of the layer.
        variants: the choice of variants under which it was found, "" for all.
    """

    rule: str
    severity: Literal["error", "warning"]
    message: str
    where: str = ""
    variants: str = ""

    def __str__(self) -> str:
        place = " ".join(
            part for part in (self.where, self.variants and f"[{self.variants}]") if part
        )
        return f"{self.severity}: {self.rule}{' at ' if place else ''}{place}: {self.message}"


def check_field(prim: "Usd.Prim") -> Iterator[Finding]:
    """Yield what is wrong with a field; of an animated one, with its first sample."""
    try:
        found = [*_check_values(prim)]
    except UsdError as error:
        found = [_error("attribute-type", str(error))]
    rest = (*_check_hints(prim), *_check_color_space(prim), *_check_transform(prim))
    for finding in (*found, *rest):
        yield replace(finding, where=str(prim.GetPath()))


def check_stage(stage: "Usd.Stage") -> Iterator[Finding]:
    """Yield what is wrong with a scene as a whole."""
    fields = [str(prim.GetPath()) for prim in find_fields(stage)]
    if not fields:
        yield _error("one-field", "no field of splats in the scene")
    elif len(fields) > 1:
        yield _warning(
            "one-field",
            f"{len(fields)} fields of splats ({', '.join(fields)}); some importers refuse that, or "
            "take the first",
        )
    for layer in stage.GetUsedLayers():
        for asset in sorted(layer.GetExternalReferences()):
            if _leaves_the_scene(asset):
                message = f"refers to '{asset}', expected a relative path below the scene"
                yield replace(_error("asset-path", message), where=layer.GetDisplayName())


def _error(rule: str, message: str) -> Finding:
    return Finding(rule, "error", message)


def _warning(rule: str, message: str) -> Finding:
    return Finding(rule, "warning", message)


def _leaves_the_scene(asset: str) -> bool:
    return (
        PurePosixPath(asset).is_absolute()
        or PureWindowsPath(asset).is_absolute()
        or ".." in PurePosixPath(asset.replace("\\", "/")).parts
        or "://" in asset
    )


def _check_hints(prim: "Usd.Prim") -> Iterator[Finding]:
    for name, allowed in _HINTS.items():
        found = _authored(prim, name)
        if found is None:
            yield _warning("hints", f"'{name}' is not authored; renderers will take '{allowed[0]}'")
        elif found not in allowed:
            yield _error("hints", f"'{name}' is '{found}', expected one of {', '.join(allowed)}")


def _authored(prim: "Usd.Prim", name: str) -> object:
    """Return the value of an attribute, None where it is not authored."""
    attribute = prim.GetAttribute(name)
    return attribute.Get() if attribute and attribute.HasAuthoredValue() else None


def _check_color_space(prim: "Usd.Prim") -> Iterator[Finding]:
    name, space = color_space(prim)
    if not name:
        yield _warning(
            "color-space", "no color space is authored; sRGB and linear colors cannot be told apart"
        )
    elif space is None:
        yield _error(
            "color-space",
            f"color space {quoted(name)} is neither OpenUSD's nor defined in the scene",
        )


def _check_transform(prim: "Usd.Prim") -> Iterator[Finding]:
    from pxr import Usd, UsdGeom

    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    matrix = np.array(cache.GetLocalToWorldTransform(prim)).T
    try:
        similarity = similarity_from_matrix(matrix, "the field")
    except UsdError as error:
        yield _error("transform", str(error))
        return
    if np.abs(similarity.rotation - np.eye(3)).max() > 1e-6:
        yield _warning(
            "transform",
            "the field is rotated by a transform; renderers differ on whether colors turn along",
        )


def _check_values(prim: "Usd.Prim") -> Iterator[Finding]:
    """Yield what is wrong with the arrays of a field."""
    arrays = {name: array_of(prim, name) for name in names.WIDTHS}
    positions = arrays[names.POSITIONS]
    if positions is None or len(positions) == 0:
        yield _warning("splat-count", "no splats: positions are empty or not authored")
        return
    count = len(positions)
    sh = arrays.pop(names.SH_COEFFICIENTS)
    for name, array in arrays.items():
        if array is None:
            yield _error("splat-count", f"'{name}' is not authored")
        elif len(array) != count:
            message = f"{len(array)} values in '{name}', expected {count}, one per splat"
            yield _error("splat-count", message)
    yield from _check_harmonics(prim, sh, count)
    known = {k: v for k, v in {**arrays, names.SH_COEFFICIENTS: sh}.items() if v is not None}
    broken = {name: array for name, array in known.items() if not is_finite(array)}
    for name, array in broken.items():
        bad = np.count_nonzero(~np.isfinite(array))
        yield _error("finite", f"{bad} NaN or infinite values in '{name}'")
    if broken:
        return  # comparisons with NaN would only add noise
    yield from _check_ranges(known)
    extent = extent_of(prim)
    if extent is None:
        yield _error("extent", "'extent' is not authored; viewers cannot frame the scene")
    of_each = {name: array for name, array in known.items() if len(array) == count}
    if names.SCALES in of_each and names.ORIENTATIONS in of_each:
        base = known.get(names.SH_COEFFICIENTS, np.zeros((0, 3), np.float32))
        base = base[:: max(len(base) // count, 1)]
        none, gray = np.ones(count, np.float32), np.zeros((count, 3), np.float32)
        opacities = of_each.get(names.OPACITIES, none)
        scales, quats = of_each[names.SCALES], of_each[names.ORIENTATIONS]
        colors = base if len(base) == count else gray
        for rule, message in doubts_of(positions, scales, opacities, colors):
            yield _warning(rule, message)
        if extent is not None:
            yield from _check_extent(SplatArrays(positions, quats, scales, none, gray), extent)


def _check_harmonics(prim: "Usd.Prim", sh: np.ndarray | None, count: int) -> Iterator[Finding]:
    authored = _authored(prim, names.SH_DEGREE)
    degree = authored if isinstance(authored, int) else names.FALLBACK_DEGREE
    if not isinstance(authored, int):
        yield _warning("sh-degree", "the degree is not authored; readers take it for 3")
    if not 0 <= degree <= MAX_DEGREE:
        yield _error("sh-degree", f"degree {degree}, expected 0 to {MAX_DEGREE}")
        return
    if sh is None:
        yield _error("sh-count", "no coefficients: every splat is gray")
        return
    per_splat = (degree + 1) ** 2
    if len(sh) != count * per_splat:
        message = f"{len(sh)} coefficients, expected {count} x {per_splat} for degree {degree}"
        yield _error("sh-count", message)
    own = stored(prim, names.SH_COEFFICIENTS)
    for name, expected in (("elementSize", per_splat), ("interpolation", "vertex")):
        if own and (found := own[0].GetMetadata(name)) != expected:
            shown = "not authored" if found is None else repr(found)
            yield _error("sh-metadata", f"{name} is {shown}, expected {expected!r}")


def _check_ranges(arrays: dict[str, np.ndarray]) -> Iterator[Finding]:
    nothing = np.zeros(0)
    opacities = arrays.get(names.OPACITIES, nothing)
    if len(opacities) and (opacities.min() < 0 or opacities.max() > 1):
        found = f"opacities from {opacities.min():.3g} to {opacities.max():.3g}"
        yield _error("opacity-range", f"{found}, expected 0 to 1; are these logits?")
    scales = arrays.get(names.SCALES, nothing)
    smallest = scales.min(initial=1)
    if smallest < 0:
        message = f"scales down to {smallest:.3g}, expected above 0; are these logarithms?"
        yield _error("scale-range", message)
    elif smallest == 0:
        zeros = np.count_nonzero((scales == 0).any(axis=1))
        lost = " (below 6e-8 a half becomes 0)" if scales.dtype == np.float16 else ""
        yield _error("scale-range", f"{zeros} splats with a scale of 0, expected above 0{lost}")
    quats = arrays.get(names.ORIENTATIONS, np.zeros((0, 4))).astype(np.float32, copy=False)
    error = np.abs(np.sqrt(np.einsum("ni,ni->n", quats, quats)) - 1)
    if bad := np.count_nonzero(error > QUAT_TOLERANCE):
        message = f"{bad} quaternions are not of length 1 (off by up to {error.max():.3g})"
        yield _error("quaternion-length", message)


def _check_extent(splats: SplatArrays, extent: np.ndarray) -> Iterator[Finding]:
    if not np.isfinite(extent).all():
        yield _error("extent", "'extent' is NaN or infinite")
        return
    low, high = three_sigma_extent(splats).astype(np.float64)
    diagonal = float(np.linalg.norm(high - low))
    missing = max(float((extent[0] - low).max()), float((high - extent[1]).max()))
    if missing > EXTENT_TOLERANCE * diagonal:
        yield _error(
            "extent",
            f"'extent' cuts off splats by up to {missing:.3g}: it has to hold every 3-sigma ellipsoid, "
            "not only the centers",
        )
    if float(np.linalg.norm(extent[1] - extent[0])) > (1 + MAX_SLACK) * diagonal:
        yield _warning("extent", "'extent' is much larger than the splats")
