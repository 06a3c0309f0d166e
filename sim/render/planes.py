"""The planes that the objects of a scene stand on: the top of a table, and the floor of the surround."""

from dataclasses import dataclass

import numpy as np

from digs_warp.data.images import linear_from_srgb
from digs_warp.sim.render.ground_light import Plane
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import FURNITURE, Material, Scene

# A floor has no end within its surround [m].
ENDLESS = 1e5

# Level faces of the furniture (cosine), this near to the lowest point of the objects [m], carry them.
LEVEL, CONTACT = 0.999, 0.002


@dataclass(frozen=True)
class Planes:
    """What things stand on; None: there is none."""

    table: Plane | None
    floor: Plane | None


def planes_of(scene: Scene, environment: Environment) -> Planes:
    """Return the planes of a scene in its surround."""
    floor = None
    if environment.floor is not None:
        ends = np.full(2, ENDLESS)
        floor = Plane(environment.floor, -ends, ends, _box(scene.vertices))
    return Planes(_table_top(scene), floor)


def _table_top(scene: Scene) -> Plane | None:
    """Return the level face of the furniture that the objects stand on."""
    if not scene.has_furniture:
        return None
    corners = scene.vertices[scene.faces].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = across[:, 2] > LEVEL * np.linalg.norm(across, axis=1)
    objects = _box(scene.object_vertices)
    near = np.abs(corners[..., 2] - objects[0, 2]).max(axis=1) < CONTACT
    top = (scene.face_objects == FURNITURE) & level & near
    if not top.any():
        return None
    low, high = _box(corners[top].reshape(-1, 3))
    number = int(scene.face_materials[top][0])
    albedo = _albedo(scene.materials[number])
    # Furniture may stand on the table, too.
    others = scene.vertices[np.unique(scene.faces[scene.face_materials != number])]
    things = _box(others[others[:, 2] > high[2] - CONTACT])
    return Plane(float(high[2]), low[:2], high[:2], things, albedo, number)


def _albedo(material: Material) -> np.ndarray:
    """Return the mean color of a material, linear, (3,)."""
    if material.texture is None:
        return material.base_color
    # By a table, as for panoramas: textures are large.
    linear = linear_from_srgb(np.arange(256) / 255.0)
    return material.base_color * linear[material.texture].mean(axis=(0, 1))


def _box(points: np.ndarray) -> np.ndarray:
    """Return the lowest and highest coordinates, (2, 3)."""
    return np.stack([points.min(axis=0), points.max(axis=0)]).astype(np.float64)
