# pxr comes without type stubs:
# pyright: reportAttributeAccessIssue=false
"""Reads Gaussians from a USD scene, ours or another program's.

Attributes are found by name, so that files open in versions of USD that do not know the splat schema.
What the file leaves out has the schema's default.
"""

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.gaussians import Gaussians
from digs_warp.sh import MAX_DEGREE, coefficient_count
from usd import names
from usd.convert import (
    SplatArrays,
    check_activated,
    check_rows,
    gaussians_from_arrays,
    transformed,
)
from usd.files import HINT, open_stage
from usd.frames import world_from_prim
from usd.metadata import json_from_usd

if TYPE_CHECKING:
    from pxr import Usd

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class UsdScene:
    """What a USD scene holds for us.

    Attributes:
        gaussians: the splats in our world (z up, metres).
        metadata: our provenance dictionary; empty in files of other programs.
        prim_path: where the splats lie in the stage.
    """

    gaussians: Gaussians
    metadata: dict[str, Any]
    prim_path: str


def read_gaussians(path: Path, prim_path: str | None = None) -> Gaussians:
    """Return the Gaussians of a USD scene in our world; see `read_scene`."""
    return read_scene(path, prim_path).gaussians


def read_scene(path: Path, prim_path: str | None = None) -> UsdScene:
    """Read the Gaussians and the metadata of a ``.usda``, ``.usdc`` or ``.usdz`` file.

    The prim's transform, the stage's ``upAxis`` and ``metersPerUnit`` are applied to positions,
    orientations, scales and spherical harmonics.

    Args:
        path: the scene.
        prim_path: which splats to read where a scene holds several fields.

    Raises:
        UsdError: the file is missing, truncated or not USD; it holds no splats, or several fields and no
            ``prim_path`` is given; values are NaN, infinite or not activated; the transform is not a
            similarity.
    """
    stage = open_stage(path)
    prim = find_field(stage, path, prim_path)
    # In a function of its own: arrays that outlive the stage make USD copy the mapped file.
    gaussians = _read_gaussians(prim, f"USD scene '{path}', {prim.GetPath()}")
    return UsdScene(gaussians, read_metadata(stage), str(prim.GetPath()))


def find_field(stage: "Usd.Stage", path: Path, prim_path: str | None = None) -> "Usd.Prim":
    """Return the prim that holds the splats, or raise a `UsdError` that lists what there is."""
    from pxr import Sdf, Usd

    prims = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    fields = [prim for prim in prims if _is_field(prim)]
    found = ", ".join(str(prim.GetPath()) for prim in fields) or "none"
    if prim_path is None:
        if len(fields) != 1:
            raise UsdError(
                f"USD scene '{path}': expected one Gaussian splat field, found {len(fields)} ({found})"
                + ("; name one of them as prim_path" if fields else f". {HINT}")
            )
        return fields[0]
    valid = Sdf.Path.IsValidPathString(prim_path) and Sdf.Path(prim_path).IsAbsolutePath()
    prim = stage.GetPrimAtPath(prim_path) if valid else None
    if not prim or not _has_positions(prim):
        raise UsdError(f"USD scene '{path}': no Gaussian splats at '{prim_path}', found: {found}")
    return prim


def read_metadata(stage: "Usd.Stage") -> dict[str, Any]:
    """Return our provenance dictionary of the scene, empty when it has none."""
    data = stage.GetMetadata("customLayerData") or {}
    ours = data.get(names.METADATA_KEY, {})
    return json_from_usd(ours) if isinstance(ours, dict) else {}


def splat_count(prim: "Usd.Prim") -> int:
    """Return the number of splats: the length of the positions."""
    positions = _value(prim, names.POSITIONS)
    return 0 if positions is None else len(positions)


def sh_layout(prim: "Usd.Prim", count: int, what: str) -> tuple[int, int]:
    """Return the degree (0 to 3) and the number of coefficients stored per splat (0: no usable ones).

    The length of the array decides where the authored degree does not fit it.
    """
    authored = (
        prim.GetAttribute(names.SH_DEGREE).Get() if prim.HasAttribute(names.SH_DEGREE) else None
    )
    degree = names.FALLBACK_DEGREE if authored is None else authored
    values = _value(prim, names.SH_COEFFICIENTS)
    length = 0 if values is None else len(values)
    if count == 0:
        return min(max(degree, 0), MAX_DEGREE), coefficient_count(min(max(degree, 0), MAX_DEGREE))
    stored = length // count
    if length == 0:
        return 0, 0
    actual = round(stored**0.5) - 1
    if length != count * stored or stored != (actual + 1) ** 2:
        _log.warning("%s: %d SH coefficients do not fit %d splats; shown grey", what, length, count)
        return 0, 0
    if actual != degree:
        _log.warning("%s: SH degree %s, but the array holds degree %d", what, authored, actual)
    if actual > MAX_DEGREE:
        _log.warning("%s: SH degree %d, cut down to %d", what, actual, MAX_DEGREE)
    return min(actual, MAX_DEGREE), stored


def _read_gaussians(prim: "Usd.Prim", what: str) -> Gaussians:
    arrays = _read_arrays(prim, what)
    check_rows(arrays, what)
    check_activated(arrays.scales, arrays.opacities, what)
    return gaussians_from_arrays(transformed(arrays, world_from_prim(prim, what)))


def _is_field(prim: "Usd.Prim") -> bool:
    if prim.GetTypeName() == names.FIELD_TYPE:
        return True
    # A prim without a type that carries the attributes. Positions alone would also fit other prims.
    own = (names.SH_COEFFICIENTS, names.OPACITIES)
    return (
        not prim.GetTypeName()
        and _has_positions(prim)
        and any(_value(prim, name) is not None for name in own)
    )


def _has_positions(prim: "Usd.Prim") -> bool:
    return any(prim.HasAttribute(names.POSITIONS + suffix) for suffix in ("", names.HALF_SUFFIX))


def _read_arrays(prim: "Usd.Prim", what: str) -> SplatArrays:
    """Return the arrays in the prim's local frame; some still lie in the mapped file."""
    count = splat_count(prim)
    degree, stored = sh_layout(prim, count, what)
    if stored and count:
        sh = _array(prim, names.SH_COEFFICIENTS, count * stored, 3, what)
    else:
        sh = None
    coefficients = coefficient_count(degree)
    if sh is None:  # the schema's default: mid grey from every side
        sh = np.zeros((count, coefficients, 3), dtype=np.float32)
    sh = sh.reshape(count, -1 if count else coefficients, 3)[:, :coefficients]
    positions = _array(prim, names.POSITIONS, count, 3, what)
    quats = _array(prim, names.ORIENTATIONS, count, 4, what)
    scales = _array(prim, names.SCALES, count, 3, what)
    opacities = _array(prim, names.OPACITIES, count, None, what)
    return SplatArrays(
        positions=np.zeros((0, 3), dtype=np.float32) if positions is None else positions,
        orientations=np.zeros((count, 4), dtype=np.float32) if quats is None else quats,
        scales=np.ones((count, 3), dtype=np.float32) if scales is None else scales,
        opacities=np.ones(count, dtype=np.float32) if opacities is None else opacities,
        sh=sh,
    )


def _array(
    prim: "Usd.Prim", name: str, count: int, width: int | None, what: str
) -> np.ndarray | None:
    """Return ``count`` rows as float32, or None where the default applies (absent or too short)."""
    value = _value(prim, name)
    if value is None or count == 0:
        return None
    if len(value) < count:
        _log.warning("%s: %d %s for %d splats; the default is used", what, len(value), name, count)
        return None
    if len(value) > count:
        _log.warning("%s: %d %s for %d splats; the rest is ignored", what, len(value), name, count)
    array = np.asarray(value)
    if array.shape[1:] != (() if width is None else (width,)) or array.dtype.kind != "f":
        raise UsdError(
            f"{what}: attribute '{name}' holds {prim.GetAttribute(name).GetTypeName()}, "
            f"expected {'numbers' if width is None else f'groups of {width} numbers'}"
        )
    return array[:count].astype(np.float32, copy=False)


def _value(prim: "Usd.Prim", name: str) -> Any:
    """Return the array of an attribute or of its half-precision twin: float first when not empty."""
    from pxr import Usd

    for twin in (name, name + names.HALF_SUFFIX):
        attribute = prim.GetAttribute(twin)
        value = attribute.Get(Usd.TimeCode.EarliestTime()) if attribute else None
        if value is not None and len(value):
            return value
    return None
