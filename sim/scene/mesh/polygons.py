"""Polygons and strips as triangles; a fan would fill the notches of a letter or a window frame."""

from collections.abc import Sequence

import numpy as np

# Quadrilaterals with a notch are rare, and there may be millions of others.
MOST_FAN = 4

# In strips, this number begins a new one.
_NEW_STRIP = -1


def triangulated(
    sizes: np.ndarray, corners: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles of polygons as places in ``corners``, (m, 3), and the polygon of each, (m,).

    Args:
        sizes: number of corners of each polygon, (n,), int.
        corners: the point of each corner, one polygon after the other.
        points: shape (k, 3).
    """
    starts = np.cumsum(sizes) - sizes
    places, owners = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for size in np.unique(sizes[sizes >= 3]).tolist():
        own = np.flatnonzero(sizes == size)
        fan = np.array([(0, at, at + 1) for at in range(1, size - 1)])
        cuts = np.broadcast_to(fan, (len(own), size - 2, 3))
        if size > MOST_FAN:
            of_each = (points[corners[start : start + size]] for start in starts[own])
            cuts = np.array([cut_ears(each) or fan for each in of_each])
        places.append((starts[own][:, None, None] + cuts).reshape(-1, 3))
        owners.append(np.repeat(own, size - 2))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(places)[order], owner[order]


def cut_ears(points: np.ndarray) -> list[tuple[int, int, int]]:
    """Return the triangles of a polygon, (n, 3), by cutting off its ears; empty for a convex one."""
    flat = _in_plane(points)
    left = list(range(len(flat)))
    if all(_turn(flat, *_beside(left, at)) >= 0 for at in left):
        return []
    triangles = []
    while len(left) > 3:
        at = next((at for at in range(len(left)) if _is_ear(flat, left, at)), 0)
        triangles.append(_beside(left, at))
        del left[at]
    return [*triangles, (left[0], left[1], left[2])]


def _in_plane(points: np.ndarray) -> np.ndarray:
    """Return the corners in the plane of the polygon, counterclockwise, (n, 2)."""
    moved = points - points[0]
    normal = np.cross(moved, np.roll(moved, -1, axis=0)).sum(axis=0)  # Newell
    axis = int(np.abs(normal).argmax())
    kept = moved[:, [(axis + 1) % 3, (axis + 2) % 3]]
    return kept if normal[axis] >= 0 else kept[:, ::-1]


def _beside(left: Sequence[int], at: int) -> tuple[int, int, int]:
    """Return a corner with those before and after it."""
    return left[at - 1], left[at], left[(at + 1) % len(left)]


def _turn(flat: np.ndarray, a: int, b: int, c: int) -> float:
    """Return twice the area of a triangle, positive if it is counterclockwise."""
    (ux, uy), (vx, vy) = flat[b] - flat[a], flat[c] - flat[a]
    return float(ux * vy - uy * vx)


def _is_ear(flat: np.ndarray, left: Sequence[int], at: int) -> bool:
    """Whether the triangle at a corner lies in the polygon and holds no other corner."""
    a, b, c = _beside(left, at)
    if _turn(flat, a, b, c) <= 0:
        return False
    others = (each for each in left if each not in (a, b, c))
    return not any(
        min(_turn(flat, a, b, p), _turn(flat, b, c, p), _turn(flat, c, a, p)) >= 0 for p in others
    )


def strip_triangles(corners: np.ndarray) -> np.ndarray:
    """Return the triangles of strips, (n, 3): every second one is the other way around."""
    pieces = []
    for strip in np.split(corners, np.flatnonzero(corners == _NEW_STRIP)):
        strip = strip[strip != _NEW_STRIP]
        triangles = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
        triangles[1::2] = triangles[1::2, ::-1]
        pieces.append(triangles)
    return np.concatenate(pieces)
