"""Reads Gaussians, or facts about them, from a USD scene, ours or another program's, into our world."""

import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import Gaussians
from digs_warp.device.threads import over_rows
from digs_warp.geometry.rigid import far_offset
from digs_warp.usd import names
from digs_warp.usd.convert import (
    SplatArrays,
    check_activated,
    check_rows,
    gaussians_from_arrays,
    srgb_coefficients,
    transformed,
)
from digs_warp.usd.field import (
    color_space,
    extent_of,
    find_field,
    read_arrays,
    splat_count,
    stored,
    stored_sh_degree,
    value_of,
)
from digs_warp.usd.files import opened_stage
from digs_warp.usd.frames import (
    metres_per_unit,
    similarity_from_matrix,
    stage_offset,
    world_from_prim,
)
from digs_warp.usd.metadata import filter_of, read_metadata
from digs_warp.usd.walk import variant_sets
from digs_warp.words import quoted

if TYPE_CHECKING:
    from pxr import Usd

_log = logging.getLogger(__name__)

# Beginnings of the names of color spaces: as the scene or as the display, one curve.
_SRGB, _LINEAR, _OURS = "srgb", "lin_", ("lin_rec709", "lin_srgb")

# Splats that tell where a scene lies.
SAMPLED = 65536


@dataclass(frozen=True, eq=False)
class UsdScene:
    """The Gaussians of a USD scene.

    Attributes:
        gaussians: the splats in our world (z up, metres).
        metadata: our provenance dictionary; empty in files of other programs.
        prim_path: path of the prim with the splats.
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

    From a file that `digs_warp.usd.writer` wrote in float precision, positions come back exactly;
    log-scales to 1e-6 and opacities to 1e-7 (they pass through exp and the logistic function); orientations,
    normalized and with w >= 0, to 2e-7; SH coefficients of degree 0 and 1 exactly, higher ones to 1e-6
    of the largest in the band. Halves are rounded to 11 bits.

    Args:
        path: the scene.
        prim_path: which splats to read where a scene holds several fields.

    Raises:
        UsdError: the file is missing, truncated or not USD; it holds no splats, or several fields and no
            ``prim_path`` is given; values are NaN, infinite or not activated; the transform is not a
            similarity.
    """
    with opened_stage(path) as stage:
        return _read(stage, find_field(stage, path, prim_path), path)


def _read(stage: "Usd.Stage", prim: "Usd.Prim", path: Path) -> UsdScene:
    # A separate function, so that no array outlives the stage: USD would copy the mapped file.
    metadata = read_metadata(stage)
    gaussians = replace(
        _read_gaussians(prim, f"USD scene '{path}', {prim.GetPath()}"),
        screen_filter=filter_of(metadata, f"USD scene '{path}', metadata"),
    )
    return UsdScene(gaussians, metadata, str(prim.GetPath()))


def _read_gaussians(prim: "Usd.Prim", what: str) -> Gaussians:
    arrays = read_arrays(prim, what)
    is_linear = _has_linear_colors(prim, what)
    world_from_local = world_from_prim(prim, what)
    offset = stage_offset(prim.GetStage())
    some = arrays.positions[:: 1 + len(arrays) // SAMPLED].astype(np.float64)
    some = some @ world_from_local[:3, :3].T + world_from_local[:3, 3]
    some = some[np.isfinite(some).all(axis=1)]
    if offset is None and len(some) and (far := far_offset(some)) is not None:
        world_from_local[:3, 3] -= far
        x, y, z = offset = tuple(far.tolist())
        step = metres_per_unit(prim.GetStage(), what) * np.spacing(np.abs(arrays.positions).max())
        _log.warning(
            "%s: (%g, %g, %g) m are taken off, and kept as world_offset; its positions have steps of %.2g m",
            *(what, x, y, z, step),
        )
    similarity = similarity_from_matrix(world_from_local, what)
    count = len(arrays)
    read = Gaussians(
        means=np.empty((count, 3), np.float32),
        log_scales=np.empty((count, 3), np.float32),
        quats=np.empty((count, 4), np.float32),
        opacity_logits=np.empty(count, np.float32),
        sh=np.empty(arrays.sh.shape, np.float32),
        world_offset=offset,
    )

    def work(rows: slice) -> None:
        part = arrays.floats(rows)
        _check(part, what)
        if is_linear:
            part = replace(part, sh=srgb_coefficients(part.sh))
        # The coefficients are most of the data: they are written straight to their place.
        part = transformed(part, similarity, read.sh[rows])
        raw = gaussians_from_arrays(part)
        for name in ("means", "log_scales", "quats", "opacity_logits"):
            getattr(read, name)[rows] = getattr(raw, name)

    try:
        over_rows(count, work)
    except UsdError:
        _check(arrays.floats(slice(None)), what)  # says what is wrong with all of them
        raise
    return read


def _has_linear_colors(prim: "Usd.Prim", what: str) -> bool:
    """Whether a field's colors are linear ones of Rec.709; others are taken for sRGB."""
    if value_of(prim, names.SH_COEFFICIENTS) is None:  # display colors have a space of their own
        return False
    name, _ = color_space(prim)
    if name.startswith(_LINEAR):
        _log.warning(
            "%s: its colors are in %s; converted to sRGB%s. Where splats overlap, they blend otherwise",
            *(what, quoted(name), "" if name.startswith(_OURS) else " as if it was lin_rec709"),
        )
        return True
    if name and name not in ("raw", "data") and not name.lower().startswith(_SRGB):
        _log.warning("%s: colors in %s are taken for sRGB", what, quoted(name))
    return False


def _check(arrays: SplatArrays, what: str) -> None:
    check_rows(arrays, what)
    check_activated(arrays, what)


def describe(path: Path, prim_path: str | None = None) -> dict[str, Any]:
    """Return facts about a scene: JSON-like, quick also for large files.

    Keys: ``splats``, ``sh_degree``, ``precision`` ("float", "mixed" or "half"), ``extent`` (corners in the
    prim's own frame and units, None when there is none), ``up_axis``, ``meters_per_unit``,
    ``color_space`` ("": none), ``bytes``, ``prim_path``, ``variants`` (names by set), ``cameras`` (prim
    paths), ``views`` (time codes of the timeline, 0 without one), ``metadata``.

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
    held = {name: stored(prim, name) for name in names.WIDTHS}
    halves = [name for name, own in held.items() if own and own[0].GetName() != name]
    views = 1 + round(stage.GetEndTimeCode() - stage.GetStartTimeCode())
    return {
        "splats": count,
        "sh_degree": stored_sh_degree(prim, count, f"USD scene '{path}'") or 0,
        "precision": "float" if not halves else "half" if names.POSITIONS in halves else "mixed",
        "extent": extent.tolist() if extent is not None and count else None,
        "up_axis": str(UsdGeom.GetStageUpAxis(stage)),
        "meters_per_unit": metres_per_unit(stage, f"USD scene '{path}'"),
        "color_space": color_space(prim)[0],
        "bytes": path.stat().st_size,
        "prim_path": str(prim.GetPath()),
        "variants": {name: variants for (_, name), variants in variant_sets(stage).items()},
        "cameras": [str(each.GetPath()) for each in stage.Traverse() if each.IsA(UsdGeom.Camera)],
        "views": views if stage.HasAuthoredTimeCodeRange() else 0,
        "metadata": read_metadata(stage),
    }
