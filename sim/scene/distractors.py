"""Things that stand beside the objects and are none: they hide and resemble them, and are in no mask."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import FURNITURE, Scene
from digs_warp.sim.scene.shapes import plain_shape

# Identify them in the seeds, apart from the arrangement of objects.
SHAPES, PLACES = 301, 302

# In radii of the objects: sizes of plain shapes and of other meshes, how far out they stand, and the gap.
SHAPE_RADII = (0.1, 0.3)
MESH_RADIUS = 0.4
REACH = 1.9
GAP = 0.04

# They keep to this share of the camera's distance, so that it does not run into them.
NEAR_SHARE = 0.75

# Places that are tried for each; then it is made smaller.
TRIES = 100
SHRINKING = 0.8


def add_distractors(
    scene: Scene, count: int, meshes: Sequence[Path], seed: int, distance: float
) -> Scene:
    """Return the objects among things that belong to no object.

    Args:
        scene: the objects, which stay where they are.
        count: number of plain shapes.
        meshes: files of things in their real size; those that are too large for their place are scaled.
        seed: of their forms and places.
        distance: of the camera from the origin, at least [m].
    """
    if not count and not meshes:
        return scene
    radius = scene.object_radius
    rng = np.random.default_rng([seed, SHAPES])
    things = [_mesh(path, MESH_RADIUS * radius) for path in meshes]
    things += [plain_shape(rng, radius * rng.uniform(*SHAPE_RADII)) for _ in range(count)]
    inner = float(np.linalg.norm(scene.object_vertices[:, :2], axis=1).max())
    outer = max(min(REACH * radius, NEAR_SHARE * distance), 1.2 * inner)
    sizes = [float(np.linalg.norm(each.vertices[:, :2], axis=1).max()) for each in things]
    circles = places(sizes, inner, outer, GAP * radius, np.random.default_rng([seed, PLACES]))
    floor = float(scene.object_vertices[:, 2].min())
    standing = [
        _moved(thing, circle, circle[2] / size, floor)
        for thing, circle, size in zip(things, circles, sizes, strict=True)
    ]
    return join_scenes(scene, *standing)


def places(
    sizes: Sequence[float], inner: float, outer: float, gap: float, rng: np.random.Generator
) -> list[np.ndarray]:
    """Return circles (x, y, radius) in a ring around the origin that do not overlap.

    Args:
        sizes: their radii [m]; those for which there is no place get smaller ones.
        inner: radius of the hole in the ring [m].
        outer: radius of the ring [m], above ``inner`` + ``gap``.
        gap: between circles, and between them and the hole [m].
        rng: source of places.
    """
    found: list[np.ndarray] = []
    for size in sizes:
        radius = min(size, (outer - inner - gap) / 2)
        while (circle := _place(radius, found, inner + gap, outer, gap, rng)) is None:
            radius *= SHRINKING
        found.append(circle)
    return found


def _place(
    radius: float,
    others: Sequence[np.ndarray],
    inner: float,
    outer: float,
    gap: float,
    rng: np.random.Generator,
) -> np.ndarray | None:
    for _ in range(TRIES):
        away, angle = rng.uniform(inner + radius, outer - radius), rng.uniform(0, 2 * np.pi)
        circle = np.array([away * np.cos(angle), away * np.sin(angle), radius])
        if all(np.hypot(*(circle - o)[:2]) > radius + o[2] + gap for o in others):
            return circle
    return None


def _mesh(path: Path, most: float) -> Scene:
    """Return the mesh as furniture, at most so large that a circle of radius ``most`` [m] holds its plan."""
    from digs_warp.sim.scene.load import load_scene

    scene = load_scene(path)
    middle = (scene.vertices.min(axis=0) + scene.vertices.max(axis=0)) / 2
    centered = (scene.vertices - middle).astype(np.float32)
    radius = float(np.linalg.norm(centered[:, :2], axis=1).max())
    return replace(
        scene,
        vertices=centered * np.float32(min(1.0, most / radius)),
        face_objects=np.full(len(scene.faces), FURNITURE, np.int32),
        objects=(),
    )


def _moved(scene: Scene, circle: np.ndarray, scale: float, floor: float) -> Scene:
    """Return a thing scaled and moved to its place on the floor."""
    vertices = scene.vertices.astype(np.float64) * scale
    vertices += (*circle[:2], floor - vertices[:, 2].min())
    return replace(scene, vertices=vertices.astype(np.float32))
