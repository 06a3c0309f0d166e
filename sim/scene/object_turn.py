"""The objects turned on the spot, as if somebody had put them down another way round."""

from dataclasses import replace

import numpy as np

from digs_warp.geometry.rigid import rotation_in_plane
from digs_warp.sim.scene.scene import Scene, SceneObject


def turn_objects(scene: Scene, degrees: float) -> Scene:
    """Return a scene without furniture turned about the z axis, counterclockwise from above."""
    if degrees % 360 == 0:
        return scene
    turn = np.eye(4)
    turn[:2, :2] = rotation_in_plane(np.deg2rad(degrees))
    rotation = turn[:3, :3]
    vertices = (scene.vertices.astype(np.float64) @ rotation.T).astype(np.float32)
    return replace(
        scene,
        vertices=vertices,
        normals=(scene.normals.astype(np.float64) @ rotation.T).astype(np.float32),
        objects=tuple(
            _turned(each, turn, vertices[np.unique(scene.faces[scene.face_objects == number])])
            for number, each in enumerate(scene.objects, start=1)
        ),
    )


def _turned(thing: SceneObject, turn: np.ndarray, vertices: np.ndarray) -> SceneObject:
    """Return an object whose vertices after the turn are known."""
    size = np.ptp(vertices, axis=0).astype(np.float64)
    return replace(thing, world_from_mesh=turn @ thing.world_from_mesh, size=size)
