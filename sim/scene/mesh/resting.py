"""The pose in which a mesh rests: its hull and stable poses.

A pose is judged by the convex hull: the points that touch the ground carry the object if its center of mass
is above them. How far it must tilt until it is not, is the angle of tipping: 20 degrees for a bottle that
stands.
"""

import warnings
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.geometry.rigid import matrix_from_rotation_vector

# What tips at less than this does not rest [degrees]; scanned boxes on their uneven sides tip at 5.
LEAST_TIPPING = 3.0

# More vertices than this make the hull slow; those of them that reach out are enough.
MOST_VERTICES = 100_000
DIRECTIONS = 64  # along a side of a cube, from whose middle they reach out


@dataclass(frozen=True, eq=False)
class Hull:
    """Of the mesh: corners of the faces, (m, 3, 3), and the center of mass, (3,)."""

    corners: np.ndarray
    center: np.ndarray


def hull_of(vertices: np.ndarray) -> Hull | None:
    """Return the hull; None if it has no volume."""
    from scipy.spatial import ConvexHull, QhullError

    if len(vertices) > MOST_VERTICES:
        vertices = reaching_out(vertices, DIRECTIONS)
    try:
        hull = ConvexHull(vertices)
    except (QhullError, ValueError):
        return None
    corners = vertices[hull.simplices]
    inside = corners.mean(axis=(0, 1))
    # Tetrahedra between the faces and a point inside.
    volumes = np.abs(np.linalg.det(corners - inside))
    centers = (corners.sum(axis=1) + inside) / 4
    return Hull(corners, np.average(centers, axis=0, weights=volumes))


def reaching_out(points: np.ndarray, directions: int) -> np.ndarray:
    """Return the points, (n, 3), that are farthest from the middle of their box in each direction.

    A corner of the hull is the farthest in its own direction. One is lost only where another is farther in
    nearly the same, and then it is near that one.

    Args:
        points: shape (m, 3).
        directions: cells along each side of a cube; the points of a cell have the same direction.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    # In a cube, so that the ends of a long thing have as many cells as its sides.
    away = (2 * points - low - high) / np.where(high > low, high - low, 1.0)
    side = np.abs(away).argmax(axis=1)
    rows = np.arange(len(away))
    reach = np.abs(away[rows, side])
    across = np.stack([away[rows, side - 2], away[rows, side - 1]]) / np.where(
        reach > 0, reach, 1.0
    )
    u, v = np.minimum(((across + 1) / 2 * directions).astype(np.int64), directions - 1)
    cell = ((2 * side + (away[rows, side] > 0)) * directions + u) * directions + v
    order = np.lexsort((np.square(away).sum(axis=1), cell))
    is_last = np.append(np.diff(cell[order]) != 0, True)
    return points[np.sort(order[is_last])]


def tips_over_at(hull: Hull, up: np.ndarray, carrying: np.ndarray) -> float:
    """Return how far the object must tilt to tip over [degrees]; 0 if it does not stand at all.

    Args:
        hull: of the mesh.
        up: unit vector, shape (3,).
        carrying: the points that carry it, shape (k, 3), k >= 1.
    """
    from scipy.spatial import ConvexHull, QhullError

    sides = np.linalg.svd(up[None])[2][1:]  # two axes in the plane
    try:
        edges = ConvexHull(carrying @ sides.T).equations
    except (QhullError, ValueError):  # on a line, or fewer than three points
        return 0.0
    margin = float(-(edges @ [*(sides @ hull.center), 1.0]).max())
    height = float((hull.center - carrying.mean(axis=0)) @ up)
    return float(np.rad2deg(np.arctan2(max(margin, 0.0), height)))


# Points touch the ground if they are this near it: metres, and a share of the longest side.
CONTACT, CONTACT_SHARE = 5e-4, 2e-3

# A pose this near that of the file is taken for it: uneven bases, legs of different lengths [degrees].
SAME_POSE = 5.0

# A pose is probable if it has this share of the chance of the most probable one.
PROBABLE_SHARE = 0.5

SMALLEST_TURN = 1e-9  # [rad]

# The time to find all poses grows with the faces of the hull; round things have the most, and stay round with
# fewer.
MOST_FACES = 5_000
POSE_DIRECTIONS = 16  # of `reaching_out`: at most 3,000 faces

UP = np.array([0.0, 0.0, 1.0])


def resting_turn(vertices: np.ndarray) -> np.ndarray:
    """Return the rotation after which an object rests, shape (3, 3); the identity if it rests already.

    Args:
        vertices: of its faces, in the pose it would have in the world, z up [m], shape (n, 3), finite.
    """
    hull = hull_of(vertices)
    if hull is None or _rests(hull, UP):  # a flat sheet has no stable pose
        return np.eye(3)
    return _turn_to_z(_up_of_rest(hull))


def contact_points(vertices: np.ndarray, up: np.ndarray = UP) -> np.ndarray:
    """Return the vertices that touch the ground below them, shape (k, 3)."""
    near = min(CONTACT, CONTACT_SHARE * float(np.ptp(vertices, axis=0).max()))
    heights = vertices @ up
    return vertices[heights <= heights.min() + near]


def _rests(hull: Hull, up: np.ndarray) -> bool:
    return tips_over_at(hull, up, contact_points(hull.corners.reshape(-1, 3), up)) >= LEAST_TIPPING


def _up_of_rest(hull: Hull) -> np.ndarray:
    """Return which direction is up in the pose that the object takes, shape (3,)."""
    ups, chances = stable_ups(hull)
    if not len(ups):
        return UP
    nearest_first = np.argsort(-(ups @ UP), kind="stable")
    for up in ups[nearest_first]:
        if up @ UP < np.cos(np.deg2rad(SAME_POSE)):
            break
        if _rests(hull, up):
            return up
    probable = [i for i in nearest_first if chances[i] >= PROBABLE_SHARE * chances.max()]
    return ups[probable[0]]


def stable_ups(hull: Hull) -> tuple[np.ndarray, np.ndarray]:
    """Return the directions that may be up at rest, (n, 3), and the chance of each, (n,), the best first."""
    import trimesh

    if len(hull.corners) > MOST_FACES:
        coarse = hull_of(reaching_out(hull.corners.reshape(-1, 3), POSE_DIRECTIONS))
        hull = hull if coarse is None else replace(coarse, center=hull.center)
    corners, faces = np.unique(hull.corners.reshape(-1, 3), axis=0, return_inverse=True)
    solid = trimesh.Trimesh(corners, faces.reshape(-1, 3), process=False)
    solid.fix_normals()
    outer = solid.convex_hull
    away = np.sum((hull.center - outer.triangles_center) * outer.face_normals, axis=1)
    # Rounding may put the center of a sliver outside, and trimesh would look for one inside for ever.
    if not np.all(away < 0):
        return np.zeros((0, 3)), np.zeros(0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # slivers have no chance: NaN
        transforms, chances = trimesh.poses.compute_stable_poses(solid, center_mass=hull.center)
    chances = np.nan_to_num(chances)
    return np.reshape(transforms, (-1, 4, 4))[:, 2, :3], chances


def _turn_to_z(up: np.ndarray) -> np.ndarray:
    """Return the smallest rotation that takes a unit vector to z, shape (3, 3)."""
    axis = np.cross(up, UP)
    length = float(np.linalg.norm(axis))
    if length < SMALLEST_TURN:
        return np.diag([1.0, 1.0, 1.0] if up[2] > 0 else [1.0, -1.0, -1.0])
    return matrix_from_rotation_vector(axis * (np.arctan2(length, up[2]) / length))
