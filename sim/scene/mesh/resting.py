"""Whether a mesh stands on a base: a file whose up axis is not that of its format is recorded lying down.

A pose is judged by the convex hull: the faces that look down carry the object if its center of mass is above
them. How far it must tilt until it is not, is the angle of tipping: 20 degrees for a bottle that stands. A
bottle that lies rests on a narrow strip, or rolls: faces that look only nearly down widen what carries it.
"""

from dataclasses import dataclass

import numpy as np

AXES = {"y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}

# A face looks down if it is within this angle of it [degrees]; scanned bases are uneven.
LEVEL = 2.0
# Faces within this angle widen the support of what rolls.
ROUND = 12.0
# What tips at less than this, and rolls, lies; what tips at more than the second stands [degrees]. Scanned
# boxes on their uneven sides tip at 5.
LIES_BELOW, STANDS_ABOVE = 3.0, 8.0
ROLLS_FROM = 2.0  # the angle grows by this factor with the wider support

# More vertices than this make the hull slow; those of them that reach out are enough.
MOST_VERTICES = 100_000
DIRECTIONS = 64  # along a side of a cube, from whose middle they reach out


@dataclass(frozen=True, eq=False)
class Hull:
    """Of the mesh: corners of the faces, (m, 3, 3), their outer normals, the center of mass, the volume."""

    corners: np.ndarray
    normals: np.ndarray
    center: np.ndarray
    volume: float


def better_up_axis(vertices: np.ndarray, up: str) -> str | None:
    """Return the axis, "y" or "z", on which a mesh stands while it lies with ``up`` up; None: it is right.

    Args:
        vertices: those that the faces use, shape (n, 3), finite.
        up: "y" or "z".
    """
    hull = hull_of(vertices)
    other = "z" if up == "y" else "y"
    if hull is None or tipping_angle(hull, AXES[other], LEVEL) < STANDS_ABOVE:
        return None
    angle = tipping_angle(hull, AXES[up], LEVEL)
    rolls = tipping_angle(hull, AXES[up], ROUND) > ROLLS_FROM * angle
    return other if angle == 0.0 or (angle < LIES_BELOW and rolls) else None


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
    center = np.average(centers, axis=0, weights=volumes)
    return Hull(corners, hull.equations[:, :3], center, float(volumes.sum() / 6))


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


def tipping_angle(hull: Hull, up: np.ndarray, level: float) -> float:
    """Return how far the object must tilt to tip over [degrees]; 0 if it does not stand at all.

    Args:
        hull: of the mesh.
        up: unit vector, shape (3,).
        level: a face within this angle of the horizontal carries [degrees].
    """
    carrying = hull.corners[hull.normals @ -up > np.cos(np.deg2rad(level))].reshape(-1, 3)
    return tips_over_at(hull, up, carrying) if len(carrying) else 0.0


def tips_over_at(hull: Hull, up: np.ndarray, carrying: np.ndarray) -> float:
    """Return the angle of `tipping_angle` for the points that carry the object, shape (k, 3), k >= 1."""
    from scipy.spatial import ConvexHull, QhullError

    sides = np.linalg.svd(up[None])[2][1:]  # two axes in the plane
    try:
        edges = ConvexHull(carrying @ sides.T).equations
    except (QhullError, ValueError):  # on a line, or fewer than three points
        return 0.0
    margin = float(-(edges @ [*(sides @ hull.center), 1.0]).max())
    height = float((hull.center - carrying.mean(axis=0)) @ up)
    return float(np.rad2deg(np.arctan2(max(margin, 0.0), height)))
