"""Rules for fields of splats and for whole stages; `digs_warp.usd.splat_rules` checks the values."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import PurePosixPath, PureWindowsPath
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.usd import names
from digs_warp.usd.field import color_space, extent_of, find_fields, value_of
from digs_warp.usd.findings import Finding
from digs_warp.usd.frames import similarity_from_matrix
from digs_warp.usd.splat_rules import FieldValues, check_values
from digs_warp.words import quoted

if TYPE_CHECKING:
    from pxr import Usd

_T = TypeVar("_T")

_ANIMATED = (
    names.POSITIONS,
    names.ORIENTATIONS,
    names.SCALES,
    names.OPACITIES,
    names.SH_COEFFICIENTS,
    names.EXTENT,
)
_HINTS = {
    names.PROJECTION_HINT: ("perspective", "tangential"),
    names.SORTING_HINT: ("zDepth", "cameraDistance", "rayHitDistance"),
}


def sample_times(prim: "Usd.Prim") -> list[float | None]:
    """Return all time codes at which a field has samples; [None] for one without animation."""
    times: set[float] = set()
    for name in _ANIMATED:
        for twin in (name, name + names.HALF_SUFFIX):
            attribute = prim.GetAttribute(twin)
            if attribute:
                times.update(attribute.GetTimeSamples())
    return [*sorted(times)] or [None]


def check_field(prim: "Usd.Prim") -> Iterator[Finding]:
    """Yield what is wrong with a field, at all of its time samples."""
    where = str(prim.GetPath())
    for time in sample_times(prim):
        at = where if time is None else f"{where} at time {time:g}"
        try:
            values = _values(prim, time)
        except UsdError as error:
            yield Finding("attribute-type", "error", str(error), at)
            continue
        for finding in check_values(values):
            yield replace(finding, where=at)
    for finding in (*_check_hints(prim), *_check_color_space(prim), *_check_transform(prim)):
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


def _values(prim: "Usd.Prim", time: float | None) -> FieldValues:
    coefficients = prim.GetAttribute(names.SH_COEFFICIENTS)
    if not (coefficients and coefficients.HasAuthoredValue()):
        half = prim.GetAttribute(names.SH_COEFFICIENTS + names.HALF_SUFFIX)
        coefficients = half or coefficients
    return FieldValues(
        positions=_rows(prim, names.POSITIONS, 3, time),
        orientations=_rows(prim, names.ORIENTATIONS, 4, time),
        scales=_rows(prim, names.SCALES, 3, time),
        opacities=_rows(prim, names.OPACITIES, None, time),
        sh=_rows(prim, names.SH_COEFFICIENTS, 3, time),
        degree=_degree(prim),
        element_size=_metadata(coefficients, "elementSize", int),
        interpolation=_metadata(coefficients, "interpolation", str),
        extent=extent_of(prim, time),
    )


def _degree(prim: "Usd.Prim") -> int | None:
    attribute = prim.GetAttribute(names.SH_DEGREE)
    value = attribute.Get() if attribute and attribute.HasAuthoredValue() else None
    return value if isinstance(value, int) else None


def _metadata(attribute: "Usd.Attribute", name: str, kind: type[_T]) -> _T | None:
    value = attribute.GetMetadata(name) if attribute else None
    return value if isinstance(value, kind) else None


def _rows(prim: "Usd.Prim", name: str, width: int | None, time: float | None) -> np.ndarray | None:
    value = value_of(prim, name, time)
    if value is None:
        return None
    array = np.asarray(value)
    if array.dtype.kind != "f" or array.shape[1:] != (() if width is None else (width,)):
        raise UsdError(f"'{name}' holds {type(value).__name__}")
    return array


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
