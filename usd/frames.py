"""The frames of a USD stage and of our world (z up, metres), and the transforms between them.

Matrices are (4, 4) and act on column vectors, ``points_b = b_from_a @ points_a``; `pxr.Gf` matrices act
on row vectors and are transposed here.
"""

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.usd import names
from digs_warp.usd.metadata import read_metadata

if TYPE_CHECKING:
    from pxr import Usd

logger = logging.getLogger(__name__)

# Our scenes are Y-up, the frame most viewers expect: (x, y, z) -> (x, z, -y). A signed permutation, so
# that baking it into positions is exact.
ASSET_FROM_WORLD = np.array(
    [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)

# How far a transform may be from uniform scale and rotation: more than float32 matrices and Euler angles in
# degrees need, less than a visible shear.
SIMILARITY_TOLERANCE = 1e-5


@dataclass(frozen=True, eq=False)
class Similarity:
    """``points_b = scale * rotation @ points_a + translation``; scale > 0, rotation right-handed."""

    scale: float
    rotation: np.ndarray
    translation: np.ndarray


def similarity_from_matrix(b_from_a: np.ndarray, what: str) -> Similarity:
    """Split a (4, 4) matrix into uniform scale, rotation and translation.

    Raises:
        UsdError: the matrix mirrors, shears, scales the axes differently, or is not finite.
    """
    linear = b_from_a[:3, :3]
    volume = np.linalg.det(linear) if np.isfinite(b_from_a).all() else np.nan
    if not volume > 0:
        raise UsdError(
            f"{what}: the transform mirrors, collapses or is not finite (determinant {volume:.3g}); "
            "expected rotation, translation and uniform scale. Bake the transform first."
        )
    scale = float(np.cbrt(volume))
    rotation = linear / scale
    error = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if error > SIMILARITY_TOLERANCE:
        raise UsdError(
            f"{what}: the transform shears or scales its axes differently (off by {error:.2g}); "
            "expected rotation, translation and uniform scale. Bake the transform first."
        )
    return Similarity(scale, rotation, b_from_a[:3, 3])


def world_from_prim(prim: "Usd.Prim", what: str) -> np.ndarray:
    """Return the (4, 4) matrix from a prim's local frame to our world (z up, metres).

    It is composed of the prim's transform in the stage (its first sample),
    ``metersPerUnit`` and ``upAxis``, less the offset of a recording far from the origin.

    Raises:
        UsdError: ``metersPerUnit`` is not above 0.
    """
    from pxr import Usd, UsdGeom

    metres = metres_per_unit(prim.GetStage(), what)
    up_axis = UsdGeom.GetStageUpAxis(prim.GetStage())
    world_from_stage = np.eye(4) if up_axis == UsdGeom.Tokens.z else ASSET_FROM_WORLD.T.copy()
    world_from_stage[:3] *= metres
    # A prim of a type this USD does not know is no Xformable to the cache; its operations still count.
    code = Usd.TimeCode.EarliestTime()
    stage_from_prim = np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(prim)).T
    if not prim.IsA(UsdGeom.Xformable):
        local = UsdGeom.Xformable(prim).GetLocalTransformation(code)
        stage_from_prim = stage_from_prim @ np.array(local).T
    world_from_prim = world_from_stage @ stage_from_prim
    if offset := stage_offset(prim.GetStage()):  # ours: float32 would round what it leads to
        world_from_prim[:3, 3] -= offset
    return world_from_prim


def metres_per_unit(stage: "Usd.Stage", what: str) -> float:
    """Return what a unit of a stage is [m]; logs a warning where it does not say so.

    Raises:
        UsdError: it is not above 0.
    """
    from pxr import UsdGeom

    metres = UsdGeom.GetStageMetersPerUnit(stage)
    if not (np.isfinite(metres) and metres > 0):
        raise UsdError(f"{what}: metersPerUnit is {metres}, expected a finite number above 0")
    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        logger.warning(
            "%s: has no metersPerUnit, so it is in centimetres, as USD says. If it is in metres, all is a "
            "hundred times too small: write metersPerUnit = 1 into the file, or export it again with it",
            what,
        )
    return metres


def stage_offset(stage: "Usd.Stage") -> tuple[float, float, float] | None:
    """Return what was taken off the places of a scene of ours [m]; None: nothing."""
    offset: Any = read_metadata(stage).get(names.OFFSET_KEY)
    try:
        if np.shape(offset) != (3,) or not np.isfinite(offset).all():
            return None
    except (TypeError, ValueError):
        return None
    x, y, z = map(float, offset)
    return x, y, z
