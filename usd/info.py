"""What a USD scene of Gaussians holds, without loading the arrays."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from digs_warp.usd import names
from digs_warp.usd.convert import Precision
from digs_warp.usd.field import extent_of, find_field, splat_count, stored_sh_degree
from digs_warp.usd.files import opened_stage
from digs_warp.usd.reader import read_metadata
from digs_warp.usd.variants import variant_sets

if TYPE_CHECKING:
    from pxr import Usd


def describe(path: Path, prim_path: str | None = None) -> dict[str, Any]:
    """Return facts about a scene: JSON-like, quick also for large files.

    Keys: ``splats``, ``sh_degree``, ``precision`` ("float", "mixed" or "half"), ``extent`` (corners in the
    prim's own frame and units, None when there is none), ``up_axis``, ``meters_per_unit``, ``bytes``,
    ``prim_path``, ``variants`` (names by set), ``cameras`` (prim paths), ``views`` (time codes of the
    timeline, 0 without one), ``metadata``.

    Raises:
        UsdError: the file cannot be opened, holds no splats, or several fields and no ``prim_path``.
    """
    path = Path(path)
    with opened_stage(path) as stage:
        return _facts(stage, path, prim_path)


def _facts(stage: "Usd.Stage", path: Path, prim_path: str | None) -> dict[str, Any]:
    from pxr import UsdGeom

    prim = find_field(stage, path, prim_path)
    count = splat_count(prim)
    extent = extent_of(prim)
    return {
        "splats": count,
        "sh_degree": stored_sh_degree(prim, count, f"USD scene '{path}'") or 0,
        "precision": _precision(prim),
        "extent": extent.tolist() if extent is not None and count else None,
        "up_axis": str(UsdGeom.GetStageUpAxis(stage)),
        "meters_per_unit": UsdGeom.GetStageMetersPerUnit(stage),
        "bytes": path.stat().st_size,
        "prim_path": str(prim.GetPath()),
        "variants": {name: variants for (_, name), variants in variant_sets(stage).items()},
        "cameras": [str(each.GetPath()) for each in stage.Traverse() if each.IsA(UsdGeom.Camera)],
        "views": _time_codes(stage),
        "metadata": read_metadata(stage),
    }


def _precision(prim: "Usd.Prim") -> Precision:
    """Return the precision, from the types of the positions and the coefficients."""
    stored = {
        name: attribute.HasAuthoredValue()
        for name in (names.POSITIONS, names.SH_COEFFICIENTS)
        if (attribute := prim.GetAttribute(name + names.HALF_SUFFIX))
    }
    if stored.get(names.POSITIONS):
        return "half"
    return "mixed" if stored.get(names.SH_COEFFICIENTS) else "float"


def _time_codes(stage: "Usd.Stage") -> int:
    if not stage.HasAuthoredTimeCodeRange():
        return 0
    return 1 + round(stage.GetEndTimeCode() - stage.GetStartTimeCode())
