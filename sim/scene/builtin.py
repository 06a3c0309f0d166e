"""The built-in object and room: files of the package.

The object is a glazed vase dressed in a kilim, tied with a cord, under a thin brass handle, as a test of
reconstruction: fine woven texture with folds, a matte bowl without texture, a glossy glaze, and a handle
only a few millimetres thick. The room is textured all around, lit by windows and soft boxes.
"""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.images import linear_from_srgb, read_image
from digs_warp.sim.scene.environment import DEFAULT_RADIUS, Environment
from digs_warp.sim.scene.scene import Material, Scene, SceneObject

ASSETS = Path(__file__).parent / "assets"

NAME = "built-in object"

# Longest edge of the bounding box [m], as of loaded meshes.
SIZE = 0.5

# Steps of the stored whole numbers: along the longest edge, of a unit normal, of a texture's side.
POSITION_STEPS, NORMAL_STEPS, UV_STEPS = 32767, 511, 4096

# Columns that are repeated on either side of a stored texture, which closes round the object.
SEAM = 16

# Radiance of white in the room's image; steps of its gain for a factor of two.
WHITE, GAIN_STEPS = 1.5, 32

# In the order of the faces: color, linear; roughness; metallic. White ones have a texture of their name.
MATERIALS: dict[str, tuple[tuple[float, float, float], float, float]] = {
    "walnut": ((1.0, 1.0, 1.0), 0.45, 0.0),
    "bisque": ((0.70, 0.62, 0.50), 0.9, 0.0),
    "glaze": ((1.0, 1.0, 1.0), 0.15, 0.0),
    "kilim": ((1.0, 1.0, 1.0), 0.95, 0.0),
    "cord": ((1.0, 1.0, 1.0), 0.85, 0.0),
    "brass": ((0.80, 0.55, 0.24), 0.28, 1.0),
    "cane": ((1.0, 1.0, 1.0), 0.6, 0.0),
}


@cache
def builtin_scene() -> Scene:
    """Return the built-in object, always the same: 0.5 m tall, centered on the origin, read-only."""
    materials = []
    for name, (color, roughness, metallic) in MATERIALS.items():
        path = ASSETS / f"{name}.webp"
        texture = _texture(path) if path.is_file() else None
        base = np.array(color, np.float32)
        materials.append(Material(name, base, texture, roughness=roughness, metallic=metallic))
    scene = _vase(tuple(materials))
    for array in (*vars(scene).values(), *(each.texture for each in materials)):
        if isinstance(array, np.ndarray):
            array.flags.writeable = False
    return scene


def builtin_shape() -> Scene:
    """Return the built-in object, plain and gray, without reading its textures."""
    plain = Material("plain", np.full(3, 0.5, np.float32))
    return _vase((plain,) * len(MATERIALS))


def builtin_environment(radius: float = DEFAULT_RADIUS) -> Environment:
    """Return the built-in room: textured all around, lit by windows and soft boxes."""
    return Environment(_room_radiance(), radius, is_room=True)


@cache
def _room_radiance() -> np.ndarray:
    """Return the panorama, linear radiance, (1024, 2048, 3), float32, read-only."""
    table = linear_from_srgb(np.arange(256) / 255.0).astype(np.float32) * np.float32(WHITE)
    with np.load(ASSETS / "room.npz") as arrays:
        gain = np.exp2(np.arange(256, dtype=np.float32) / GAIN_STEPS)[arrays["gain"]]
    radiance = table[read_image(ASSETS / "room.webp")[..., :3]] * gain[..., None]
    radiance.flags.writeable = False
    return radiance


def _texture(path: Path) -> np.ndarray:
    return np.ascontiguousarray(read_image(path)[:, SEAM:-SEAM, :3])


def _vase(materials: tuple[Material, ...]) -> Scene:
    with np.load(ASSETS / "vase.npz") as arrays:
        vertices = _rows(arrays["vertices"]) / POSITION_STEPS
        normals = _rows(arrays["normals"]) / NORMAL_STEPS
        uvs, faces = _rows(arrays["uvs"]) / UV_STEPS, _rows(arrays["faces"])
        face_materials = arrays["face_materials"].astype(np.int32)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    vertices = (vertices - (low + high) / 2) * (SIZE / (high - low).max())
    size = np.ptp(vertices, axis=0)
    return Scene(
        vertices=vertices.astype(np.float32),
        faces=faces.astype(np.int32),
        face_materials=face_materials,
        normals=normals.astype(np.float32),
        uvs=uvs.astype(np.float32),
        vertex_colors=np.ones(vertices.shape, np.float32),
        materials=materials,
        objects=(SceneObject(NAME, None, np.eye(4), size),),
    )


def _rows(deltas: Any) -> np.ndarray:
    """Return the whole numbers that were stored as differences along columns, (rows, columns), int64."""
    return np.cumsum(deltas, axis=1, dtype=np.int64).T
