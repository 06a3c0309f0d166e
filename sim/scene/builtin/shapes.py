"""Smooth surfaces on grids: surfaces of revolution, tubes along curves, and surfaces through closed rings."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Patch:
    """A piece of surface with one material.

    Attributes:
        vertices: positions [m], shape (n, 3), float64.
        faces: vertex indices, counter-clockwise from outside, shape (m, 3), int64.
        normals: unit vectors, shape (n, 3).
        uvs: texture coordinates, v = 0 is the bottom row, shape (n, 2).
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray


def smooth_curve(points: np.ndarray, count: int) -> np.ndarray:
    """Return ``count`` points spaced evenly along a curve through ``points``, shape (k, d) -> (count, d).

    The curve is a centripetal Catmull-Rom spline: it passes through every point and does not overshoot.
    """
    points = np.asarray(points, np.float64)
    ends = (2 * points[:1] - points[1:2], 2 * points[-1:] - points[-2:-1])
    padded = np.concatenate([ends[0], points, ends[1]])
    knots = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(padded, axis=0), axis=1) ** 0.5)])
    t = np.linspace(knots[1], knots[-2], 24 * count)
    i = np.clip(np.searchsorted(knots, t, side="right") - 1, 1, len(padded) - 3)

    def between(a: np.ndarray, b: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
        share = ((t - knots[first]) / (knots[last] - knots[first]))[:, None]
        return (1 - share) * a + share * b

    a1 = between(padded[i - 1], padded[i], i - 1, i)
    a2 = between(padded[i], padded[i + 1], i, i + 1)
    a3 = between(padded[i + 1], padded[i + 2], i + 1, i + 2)
    b1 = between(a1, a2, i - 1, i + 1)
    b2 = between(a2, a3, i, i + 2)
    curve = between(b1, b2, i, i + 1)
    length = arc_length(curve)
    even = np.linspace(0, length[-1], count)
    return np.stack([np.interp(even, length, axis) for axis in curve.T], axis=1)


def arc_length(curve: np.ndarray) -> np.ndarray:
    """Return the length from the first point of a curve to each of its points, shape (k,)."""
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def ring_patch(rows: np.ndarray, uvs: np.ndarray) -> Patch:
    """Return the surface through closed rings of points.

    Args:
        rows: shape (k, n + 1, 3); the last point of each ring repeats the first, so that textures can close.
            Rings run counter-clockwise around the direction from row to row, seen from outside.
        uvs: shape (k, n + 1, 2).
    """
    count, around, _ = rows.shape
    index = np.arange(count * around).reshape(count, around)
    a, b = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
    c, d = index[1:, 1:].ravel(), index[1:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])

    along = np.gradient(rows, axis=0)
    open_ring = rows[:, :-1]
    turn = np.roll(open_ring, -1, axis=1) - np.roll(open_ring, 1, axis=1)
    turn = np.concatenate([turn, turn[:, :1]], axis=1)
    normals = np.cross(turn, along).reshape(-1, 3)
    vertices = rows.reshape(-1, 3)
    normals = _mended(normals, along, vertices)
    return _without_slivers(Patch(vertices, faces, normals, uvs.reshape(-1, 2)))


def _mended(normals: np.ndarray, along: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Return unit normals; where a ring has collapsed to a point, those of the neighboring ring."""
    count, around, _ = along.shape
    normals = normals.reshape(count, around, 3).copy()
    length = np.linalg.norm(normals, axis=2)
    size = np.ptp(vertices.reshape(count, around, 3), axis=1).max(axis=1)
    for row in np.flatnonzero(size < 1e-9):
        neighbor = normals[row + 1 if row == 0 else row - 1, :-1].mean(axis=0)
        normals[row], length[row] = neighbor, np.linalg.norm(neighbor)
    return (normals / length[..., None]).reshape(-1, 3)


def _without_slivers(patch: Patch) -> Patch:
    """Drop the faces without area at the poles."""
    a, b, c = np.moveaxis(patch.vertices[patch.faces], 1, 0)
    kept = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-14
    return Patch(patch.vertices, patch.faces[kept], patch.normals, patch.uvs)


def angles(segments: int) -> np.ndarray:
    """Return the angles of a closed ring [rad], 0 to a full turn, shape (segments + 1,)."""
    return np.linspace(0, 2 * np.pi, segments + 1)


def revolve(profile: np.ndarray, segments: int) -> Patch:
    """Revolve a profile, (radius, z) from bottom to top along the outside [m], shape (k, 2), around z.

    One turn is u = 0..1, and v grows by 1 over the circumference of the widest ring: texels are square there.
    """
    theta = angles(segments)
    radius, z = profile[:, :1], profile[:, 1:]
    rows = np.stack(
        [radius * np.cos(theta), radius * np.sin(theta), np.broadcast_to(z, (len(z), len(theta)))],
        axis=2,
    )
    # Exactly the first column again: cos(2 pi) is not quite cos(0).
    rows[:, -1] = rows[:, 0]
    v = arc_length(profile) / (2 * np.pi * profile[:, 0].max())
    return ring_patch(rows, grid_uvs(v, segments))


def join_patches(patches: Sequence[Patch]) -> Patch:
    """Join several patches into one."""
    starts = np.cumsum([0, *(len(patch.vertices) for patch in patches)])
    return Patch(
        vertices=np.concatenate([patch.vertices for patch in patches]),
        faces=np.concatenate(
            [patch.faces + start for patch, start in zip(patches, starts[:-1], strict=True)]
        ),
        normals=np.concatenate([patch.normals for patch in patches]),
        uvs=np.concatenate([patch.uvs for patch in patches]),
    )


def grid_uvs(v: np.ndarray, segments: int, turns: float = 1.0) -> np.ndarray:
    """Return u = 0 to ``turns`` around each ring and the given v of each row, (k, segments + 1, 2)."""
    u = np.linspace(0, turns, segments + 1)
    return np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=2)


def tube(
    path: np.ndarray,
    radius: np.ndarray | float,
    sides: int,
    uv_scale: tuple[float, float] = (1.0, 1.0),
) -> Patch:
    """Return a tube along a curve.

    Args:
        path: shape (k, 3); for a closed curve the last point repeats the first.
        radius: one number, one per point (k, 1), or one per vertex (k, sides + 1) [m].
        sides: of the cross-section.
        uv_scale: turns of the texture around the tube, and v per metre along it.
    """
    first, second = _frames(path)
    phi = angles(sides)
    circle = first[:, None] * np.cos(phi)[:, None] + second[:, None] * np.sin(phi)[:, None]
    radius = np.broadcast_to(np.asarray(radius, np.float64), (len(path), sides + 1))
    rows = path[:, None] + circle * radius[..., None]
    rows[:, -1] = rows[:, 0]
    return ring_patch(rows, grid_uvs(arc_length(path) * uv_scale[1], sides, uv_scale[0]))


def _frames(path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit normals per point that turn as little as possible along the path.

    The frame of one point is carried to the next by two reflections (Wang et al., "Computation of Rotation
    Minimizing Frames", 2008). On a closed path the remaining twist is distributed evenly.
    """
    closed = bool(np.linalg.norm(path[0] - path[-1]) < 1e-9)
    tangent = np.gradient(path, axis=0)
    if closed:
        tangent[0] = tangent[-1] = path[1] - path[-2]
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    first = np.empty_like(path)
    helper = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    first[0] = np.cross(tangent[0], helper) / np.linalg.norm(np.cross(tangent[0], helper))
    for k in range(len(path) - 1):
        step = path[k + 1] - path[k]
        square = step @ step
        normal = first[k] - 2 / square * (step @ first[k]) * step
        carried = tangent[k] - 2 / square * (step @ tangent[k]) * step
        mirror = tangent[k + 1] - carried
        square = mirror @ mirror
        first[k + 1] = normal - (2 / square * (mirror @ normal) * mirror if square > 0 else 0)
    second = np.cross(tangent, first)
    if closed:
        twist = np.arctan2(first[-1] @ second[0], first[-1] @ first[0])
        angle = -twist * np.linspace(0, 1, len(path))[:, None]
        first, second = (
            np.cos(angle) * first + np.sin(angle) * second,
            np.cos(angle) * second - np.sin(angle) * first,
        )
    return first, second
