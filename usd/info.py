# pxr comes without type stubs:
# pyright: reportAttributeAccessIssue=false
"""What a USD scene of Gaussians holds, without loading the arrays."""

from pathlib import Path
from typing import Any

from usd import names
from usd.field import find_field, splat_count, stored_sh_degree
from usd.files import open_stage
from usd.reader import read_metadata


def describe(path: Path, prim_path: str | None = None) -> dict[str, Any]:
    """Return facts about a scene: JSON-like, quick also for large files.

    Keys: ``splats``, ``sh_degree``, ``extent`` (corners in the prim's own frame and units, None when there
    is none), ``up_axis``, ``meters_per_unit``, ``bytes``, ``prim_path``, ``metadata``.

    Raises:
        UsdError: the file cannot be opened, holds no splats, or several fields and no ``prim_path``.
    """
    from pxr import Usd, UsdGeom

    path = Path(path)
    stage = open_stage(path)
    prim = find_field(stage, path, prim_path)
    count = splat_count(prim)
    attribute = prim.GetAttribute(names.EXTENT)
    extent = attribute.Get(Usd.TimeCode.EarliestTime()) if attribute else None
    return {
        "splats": count,
        "sh_degree": stored_sh_degree(prim, count, f"USD scene '{path}'") or 0,
        "extent": [list(corner) for corner in extent] if extent and count else None,
        "up_axis": str(UsdGeom.GetStageUpAxis(stage)),
        "meters_per_unit": UsdGeom.GetStageMetersPerUnit(stage),
        "bytes": path.stat().st_size,
        "prim_path": str(prim.GetPath()),
        "metadata": read_metadata(stage),
    }
