"""Points and meshes in our scenes, as guides, so that viewers do not draw them over the splats."""

from typing import TYPE_CHECKING

import numpy as np

from digs_warp.data.images import linear_from_srgb
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.usd import names
from digs_warp.usd.frames import ASSET_FROM_WORLD

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom

# The distances between points are measured on at most this many.
_SAMPLED_POINTS = 5000


def author_points(stage: "Usd.Stage", path: str, cloud: PointCloud) -> None:
    """Author a cloud as ``UsdGeomPoints``, as wide as the points are apart.

    One width per point: with a single constant one USD computes no extent.
    """
    from pxr import UsdGeom, Vt

    points = UsdGeom.Points.Define(stage, path)
    positions = Vt.Vec3fArray.FromNumpy(_in_asset(cloud.points_world))
    widths = Vt.FloatArray(len(cloud), _typical_spacing(cloud.points_world))
    points.CreatePointsAttr(positions)
    points.CreateWidthsAttr(widths)
    points.SetWidthsInterpolation(UsdGeom.Tokens.vertex)
    points.CreateExtentAttr(UsdGeom.Points.ComputeExtent(positions, widths))
    points.CreatePurposeAttr(UsdGeom.Tokens.guide)
    _author_colors(points, cloud.colors)


def author_mesh(stage: "Usd.Stage", path: str, mesh: TriangleMesh) -> None:
    """Author triangles as a ``UsdGeomMesh`` with a normal and a color per vertex."""
    from pxr import UsdGeom, Vt

    shape = UsdGeom.Mesh.Define(stage, path)
    points = _in_asset(mesh.points_world)
    positions = Vt.Vec3fArray.FromNumpy(points)
    shape.CreatePointsAttr(positions)
    shape.CreateFaceVertexCountsAttr(Vt.IntArray(len(mesh), 3))
    indices = np.ascontiguousarray(mesh.triangles.reshape(-1))
    shape.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(indices))
    shape.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    shape.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(_vertex_normals(points, mesh.triangles)))
    shape.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    shape.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(positions))
    shape.CreatePurposeAttr(UsdGeom.Tokens.guide)
    _author_colors(shape, mesh.colors)


def _author_colors(shape: "UsdGeom.Gprim", srgb: np.ndarray) -> None:
    """Author a linear ``displayColor`` per vertex."""
    from pxr import UsdGeom, Vt

    linear = linear_from_srgb(srgb).astype(np.float32)
    color = shape.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    color.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(linear)))
    color.GetAttr().SetColorSpace(names.DISPLAY_COLOR_SPACE)


def _in_asset(points_world: np.ndarray) -> np.ndarray:
    # A signed permutation: exact in float32.
    turned = points_world @ ASSET_FROM_WORLD[:3, :3].T.astype(np.float32)
    return np.ascontiguousarray(turned, dtype=np.float32)


def _typical_spacing(points: np.ndarray) -> float:
    """Return the median distance [m] to the nearest neighbor, a millimetre for fewer than two points."""
    from scipy.spatial import KDTree

    if len(points) < 2:
        return 1e-3
    sample = points[:: max(1, len(points) // _SAMPLED_POINTS)]
    distances, _ = KDTree(points).query(sample, k=2)
    return max(1e-6, float(np.median(distances[:, 1])))


def _vertex_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return unit normals, weighted by area, (n, 3), float32; up for a vertex without a face."""
    corners = points.astype(np.float64)[triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros((len(points), 3))
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], face)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    flat = length[:, 0] == 0
    normals[flat], length[flat] = (0.0, 1.0, 0.0), 1.0
    return np.ascontiguousarray(normals / length, dtype=np.float32)
