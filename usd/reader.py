# pxr comes without type stubs:
# pyright: reportAttributeAccessIssue=false
"""Reads Gaussians from a USD scene, ours or another program's, into our world."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from digs_warp.gaussians import Gaussians
from usd import names
from usd.convert import check_activated, check_rows, gaussians_from_arrays, transformed
from usd.field import find_field, read_arrays
from usd.files import open_stage
from usd.frames import world_from_prim
from usd.metadata import json_from_usd

if TYPE_CHECKING:
    from pxr import Usd


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
    orientations, scales and spherical harmonics. Animated attributes are read at their first sample.

    From a file that `usd.writer` wrote, positions come back exactly; log-scales to 1e-6 and opacities to
    1e-7 (they pass through exp and the logistic function); orientations, normalized and with w >= 0, to
    2e-7; SH coefficients of degree 0 and 1 exactly, higher ones to 1e-6 of the largest in the band.

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


def read_metadata(stage: "Usd.Stage") -> dict[str, Any]:
    """Return our provenance dictionary of the scene, empty when it has none."""
    data = stage.GetMetadata("customLayerData") or {}
    ours = data.get(names.METADATA_KEY, {})
    return json_from_usd(ours) if isinstance(ours, dict) else {}


def _read_gaussians(prim: "Usd.Prim", what: str) -> Gaussians:
    arrays = read_arrays(prim, what)
    check_rows(arrays, what)
    check_activated(arrays, what)
    return gaussians_from_arrays(transformed(arrays, world_from_prim(prim, what)))
