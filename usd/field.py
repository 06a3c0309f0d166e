"""A field of Gaussian splats in a stage: finding the prim, its attributes as NumPy arrays.

Attributes are found by name, so that files open in versions of USD that do not know the splat schema.
Attributes that are missing or too short get the schema's default; of animated ones the first sample is read.
"""

import logging
from collections.abc import Iterator
from math import isqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.data.images import srgb_from_linear
from digs_warp.geometry.sh import MAX_DEGREE, coefficient_count, sh_from_rgb
from digs_warp.usd import names
from digs_warp.usd.convert import SplatArrays
from digs_warp.usd.files import HINT, reason
from digs_warp.words import cut, first_few

if TYPE_CHECKING:
    from pxr import Gf, Usd

_log = logging.getLogger(__name__)


def find_fields(stage: "Usd.Stage") -> list["Usd.Prim"]:
    """Return all prims that hold splats, in the order of the stage."""
    from pxr import Usd

    prims = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    return [prim for prim in prims if is_field(prim)]


def find_field(stage: "Usd.Stage", path: Path, prim_path: str | None = None) -> "Usd.Prim":
    """Return the prim that holds the splats: the only one, or the one at ``prim_path``.

    Raises:
        UsdError: there is none, or there are several and no ``prim_path``; the message lists them.
    """
    from pxr import Sdf

    fields = find_fields(stage)
    found = first_few([cut(str(prim.GetPath())) for prim in fields]) or "none"
    if prim_path is not None:
        valid = Sdf.Path.IsValidPathString(prim_path) and Sdf.Path(prim_path).IsAbsolutePath()
        prim = stage.GetPrimAtPath(prim_path) if valid else None
        if not prim or not _has_positions(prim):
            raise UsdError(
                f"USD scene '{path}': no Gaussian splats at '{prim_path}'; found: {found}"
            )
        return prim
    if not fields:
        lost = [reason(RuntimeError(each)) for each in stage.GetCompositionErrors()[:1]]
        why = f" ({lost[0]})" if lost else ""
        raise UsdError(f"USD scene '{path}': holds no Gaussian splats{why}. {HINT}")
    shown = [prim for prim in fields if is_shown(prim)] or fields
    if len(shown) > 1:
        raise UsdError(
            f"USD scene '{path}': expected one field of Gaussian splats, found {len(fields)}: {found}; "
            "choose one with --prim"
        )
    if not is_shown(shown[0]):
        _log.warning("USD scene '%s': %s is invisible, and read all the same", path, found)
    if len(fields) > 1:
        _log.warning("USD scene '%s': of %s, only %s is visible", path, found, shown[0].GetPath())
    return shown[0]


def with_ancestors(prim: "Usd.Prim") -> Iterator["Usd.Prim"]:
    """Yield a prim, its parent, and so on."""
    while prim:
        yield prim
        prim = prim.GetParent()


def token_of(prim: "Usd.Prim", name: str) -> str:
    """Return an attribute that is a name, "" without one; also of types that this USD does not know."""
    from pxr import Usd

    attribute = prim.GetAttribute(name)
    return str(attribute.Get(Usd.TimeCode.EarliestTime()) or "") if attribute else ""


def is_shown(prim: "Usd.Prim") -> bool:
    """Whether renderers show a prim: visible, and no stand-in for another."""
    line = list(with_ancestors(prim))
    purpose = next((found for each in line if (found := token_of(each, "purpose"))), "")
    hidden = any(token_of(each, "visibility") == "invisible" for each in line)
    return not hidden and purpose not in ("proxy", "guide")


def color_space(prim: "Usd.Prim") -> tuple[str, "Gf.ColorSpace | None"]:
    """Return the name of the color space of a field's coefficients ("": none), and the space if known.

    USD's own resolution takes an unknown name for none.
    """
    from pxr import Gf, Usd

    line = list(with_ancestors(prim))
    own = stored(prim, names.SH_COEFFICIENTS)
    authored = [str(own[0].GetColorSpace())] if own and own[0].HasColorSpace() else []
    authored += [name for each in line if (name := token_of(each, "colorSpace:name"))]
    name = next(iter(authored), "")
    prefix = "ColorSpaceDefinitionAPI:"
    for each in line:
        for schema in each.GetAppliedSchemas():
            if schema.startswith(prefix):
                found = Usd.ColorSpaceDefinitionAPI(each, schema.removeprefix(prefix))
                if found.GetNameAttr().Get() == name:
                    return name, found.ComputeColorSpaceFromDefinitionAttributes()
    return name, Gf.ColorSpace(name) if Gf.ColorSpace.IsValid(name) else None


def is_field(prim: "Usd.Prim") -> bool:
    """Whether a prim holds splats: by its type, or without a type by its attributes."""
    if prim.GetTypeName() == names.FIELD_TYPE:
        return True
    if prim.GetTypeName() == names.GENERAL_FIELD_TYPE:
        return names.KERNEL_SCHEMA in prim.GetAppliedSchemas()
    # Positions alone would also fit other prims.
    own = (names.SH_COEFFICIENTS, names.OPACITIES)
    return (
        not prim.GetTypeName()
        and _has_positions(prim)
        and any(value_of(prim, name) is not None for name in own)
    )


def splat_count(prim: "Usd.Prim") -> int:
    """Return the number of splats: the length of the positions."""
    positions = value_of(prim, names.POSITIONS)
    return 0 if positions is None else len(positions)


def stored_sh_degree(prim: "Usd.Prim", count: int, what: str) -> int | None:
    """Return the degree of the coefficients of ``count`` splats; None when there are no usable ones.

    If the authored degree does not fit the length of the array, the length counts.
    """
    attribute = prim.GetAttribute(names.SH_DEGREE)
    authored = attribute.Get() if attribute else None
    degree = max(0, authored) if isinstance(authored, int) else names.FALLBACK_DEGREE
    values = value_of(prim, names.SH_COEFFICIENTS)
    if count == 0:
        return degree
    if values is None:
        return None
    per_splat, rest = divmod(len(values), count)
    actual = isqrt(per_splat) - 1
    if rest or actual < 0 or (actual + 1) ** 2 != per_splat:
        message = "%s: %d SH coefficients fit no degree for %d splats; they are ignored"
        _log.warning(message, what, len(values), count)
        return None
    if actual != degree:
        _log.warning(
            "%s: the SH degree is %s, but the array holds degree %d", what, authored, actual
        )
    return actual


def read_arrays(prim: "Usd.Prim", what: str) -> SplatArrays:
    """Return the splats in the prim's local frame, float32 or float16 as they are stored.

    The arrays may still be in the mapped file: if they outlive the stage, USD copies them.

    Raises:
        UsdError: an attribute has another type than the schema gives it.
    """
    count = splat_count(prim)
    of_splats = (names.POSITIONS, names.ORIENTATIONS, names.SCALES, names.OPACITIES)
    found = {name: _counted(prim, name, count, what) for name in of_splats}

    def or_default(name: str, value: float, *shape: int) -> np.ndarray:
        values = found[name]
        return np.full(shape, value, dtype=np.float32) if values is None else values

    return SplatArrays(
        positions=or_default(names.POSITIONS, 0.0, 0, 3),
        orientations=or_default(names.ORIENTATIONS, 0.0, count, 4),
        scales=or_default(names.SCALES, 1.0, count, 3),
        opacities=or_default(names.OPACITIES, 1.0, count),
        sh=_read_sh(prim, count, what),
    )


def _read_sh(prim: "Usd.Prim", count: int, what: str) -> np.ndarray:
    stored = stored_sh_degree(prim, count, what)
    degree = min(stored or 0, MAX_DEGREE)
    if count == 0:
        return np.zeros((0, coefficient_count(degree), 3), dtype=np.float32)
    if stored is None:
        return _display_colors(prim, count, what)
    if stored > MAX_DEGREE:
        _log.warning("%s: SH degree %d is reduced to %d", what, stored, MAX_DEGREE)
    rows = _counted(prim, names.SH_COEFFICIENTS, count * (stored + 1) ** 2, what)
    assert rows is not None  # stored_sh_degree has seen the array
    return rows.reshape(count, -1, 3)[:, : coefficient_count(degree)]


def _display_colors(prim: "Usd.Prim", count: int, what: str) -> np.ndarray:
    """Return coefficients of degree 0 of a field without any, as Houdini writes it: its display colors.

    Those are linear, one for all splats or one for each. The schema's default is mid gray.
    """
    value = value_of(prim, names.DISPLAY_COLOR)
    if value is None or len(value) not in (1, count):
        return np.zeros((count, 1, 3), dtype=np.float32)
    _log.warning("%s: no %s; drawn with %s", what, names.SH_COEFFICIENTS, names.DISPLAY_COLOR)
    colors = _counted(prim, names.DISPLAY_COLOR, len(value), what)
    assert colors is not None  # as long as it is
    coefficients = sh_from_rgb(srgb_from_linear(colors.astype(np.float64))).astype(np.float32)
    return np.ascontiguousarray(np.broadcast_to(coefficients, (count, 3))[:, None])


def _counted(prim: "Usd.Prim", name: str, count: int, what: str) -> np.ndarray | None:
    """Return ``count`` rows, or None where the default applies (absent or too short)."""
    try:
        array = array_of(prim, name) if count else None
    except UsdError as error:
        raise UsdError(f"{what}: {error}") from None
    if array is not None and len(array) != count:
        remedy = "the default is used" if len(array) < count else "the rest is ignored"
        _log.warning("%s: %d %s for %d splats; %s", what, len(array), name, count, remedy)
    return array[:count] if array is not None and len(array) >= count else None


def array_of(prim: "Usd.Prim", name: str) -> np.ndarray | None:
    """Return an array of `names.WIDTHS`, or colors, as it is authored; None: not at all.

    Raises:
        UsdError: it has another type than the schema gives it.
    """
    value = value_of(prim, name)
    if value is None:
        return None
    array, width = np.asarray(value), names.WIDTHS.get(name, 3)
    if array.dtype.kind != "f" or array.shape[1:] != (() if width is None else (width,)):
        raise UsdError(
            f"attribute '{name}' holds {type(value).__name__}, expected floating-point "
            + ("numbers" if width is None else f"vectors of {width}")
        )
    return array


def value_of(prim: "Usd.Prim", name: str) -> Any:
    """Return the array of an attribute, else of its half-precision twin; None when both are empty."""
    found = stored(prim, name)
    return None if found is None else found[1]


def stored(prim: "Usd.Prim", name: str) -> "tuple[Usd.Attribute, Any] | None":
    """Return the attribute that holds an array, it or its half-precision twin, and the array."""
    from pxr import Usd

    for twin in (name, name + names.HALF_SUFFIX):
        attribute = prim.GetAttribute(twin)
        if not attribute or not attribute.GetTypeName().isArray:
            continue
        value = attribute.Get(Usd.TimeCode.EarliestTime())
        if hasattr(value, "__len__") and len(value):  # a broken file may hold anything
            return attribute, value
    return None


def extent_of(prim: "Usd.Prim") -> np.ndarray | None:
    """Return the authored box, (2, 3), float64, in the prim's own frame; None without a usable one."""
    from pxr import Usd

    attribute = prim.GetAttribute(names.EXTENT)
    value = attribute.Get(Usd.TimeCode.EarliestTime()) if attribute else None
    box = np.asarray(value) if value is not None else np.empty(0)
    return box.astype(np.float64) if box.shape == (2, 3) and box.dtype.kind == "f" else None


def _has_positions(prim: "Usd.Prim") -> bool:
    return any(prim.HasAttribute(names.POSITIONS + suffix) for suffix in ("", names.HALF_SUFFIX))
