"""Surfaces made by code: of revolution, through closed rings, and boxes, cylinders, cones and balls."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.geometry.rigid import rotation_in_plane
from digs_warp.sim.scene.finishes import random_finish
from digs_warp.sim.scene.scene import FURNITURE, Material, Scene

SEGMENTS = 48
SHAPES = ("box", "cylinder", "cone", "ball")

# Height in units of the radius, except of balls.
HEIGHTS = (0.6, 2.5)
# Radius of the top of a cone over that of its foot.
TAPER = (0.2, 0.7)


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
    # At the poles, faces have no area.
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    faces = faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-14]
    return Patch(vertices, faces, normals, uvs.reshape(-1, 2))


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


def plain_shape(rng: np.random.Generator, radius: float) -> Scene:
    """Return a shape that stands at the origin, as furniture.

    Args:
        rng: source of its form and finish.
        radius: of the upright cylinder around it [m].
    """
    patch = _form(SHAPES[rng.integers(len(SHAPES))], rng, radius)
    return furniture(patch, np.zeros(len(patch.faces)), (random_finish(rng),))


def furniture(patch: Patch, face_materials: np.ndarray, materials: tuple[Material, ...]) -> Scene:
    """Return a surface as a scene without an object; ``face_materials``: index of each face's, (m,)."""
    return Scene(
        vertices=patch.vertices.astype(np.float32),
        faces=patch.faces.astype(np.int32),
        face_materials=face_materials.astype(np.int32),
        normals=patch.normals.astype(np.float32),
        uvs=patch.uvs.astype(np.float32),
        vertex_colors=np.ones((len(patch.vertices), 3), np.float32),
        materials=materials,
        face_objects=np.full(len(patch.faces), FURNITURE, np.int32),
    )


def _form(shape: str, rng: np.random.Generator, radius: float) -> Patch:
    height = radius * rng.uniform(*HEIGHTS)
    if shape == "box":
        corner = rng.uniform(0.25, 0.75) * np.pi / 2  # the diagonal of its plan fills the circle
        half = radius * np.array([np.cos(corner), np.sin(corner)])
        return _box(half, height, yaw=rng.uniform(0, np.pi))
    if shape == "ball":
        arc = np.linspace(-np.pi / 2, np.pi / 2, SEGMENTS // 2 + 1)
        return revolve(radius * np.column_stack([np.cos(arc), 1 + np.sin(arc)]), SEGMENTS)
    top = radius * (rng.uniform(*TAPER) if shape == "cone" else 1.0)
    outline = np.array([(0.0, 0.0), (radius, 0.0), (top, height), (0.0, height)])
    return join_patches([revolve(outline[i : i + 2], SEGMENTS) for i in range(3)])


def _box(half: np.ndarray, height: float, yaw: float) -> Patch:
    """Return a box of half sides ``half``, (2,), on the ground, with sharp edges."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    low = np.column_stack([corners @ rotation_in_plane(yaw).T, np.zeros(4)])
    high = low + (0, 0, height)
    sides = [np.array([low[i], low[i - 3], high[i - 3], high[i]]) for i in range(4)]
    return join_patches([_quad(each) for each in (*sides, high, low[::-1])])


def _quad(corners: np.ndarray) -> Patch:
    """Return a rectangle, corners counterclockwise from outside, (4, 3)."""
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normals = np.tile(normal / np.linalg.norm(normal), (4, 1))
    uvs = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float64)
    return Patch(corners, np.array([[0, 1, 2], [0, 2, 3]]), normals, uvs)
