"""Several scenes as one, and colors of vertices from textures."""

from dataclasses import replace

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.images import linear_from_srgb, srgb_from_linear
from digs_warp.sim.scene.scene import FURNITURE, MOST_OBJECTS, Material, Scene


def srgb_vertex_colors(scene: Scene) -> np.ndarray:
    """Return the base color at every vertex, sRGB in 0..1, shape (n, 3), float32.

    As in glTF, the product of the material's factor, its texture (bilinear, repeated) and the vertex
    color. The texture between vertices is lost. A vertex of several materials has the color of its last
    face; one without a face is white.
    """
    materials = np.full(len(scene.vertices), -1)
    materials[scene.faces.reshape(-1)] = np.repeat(scene.face_materials, 3)
    linear = np.ones((len(scene.vertices), 3))
    for number, material in enumerate(scene.materials):
        own = materials == number
        color = np.asarray(material.base_color, dtype=np.float64) * scene.vertex_colors[own]
        if material.texture is not None:
            color = color * sampled_texture(material.texture, scene.uvs[own])
        linear[own] = color
    return srgb_from_linear(np.clip(linear, 0.0, 1.0)).astype(np.float32)


def sampled_texture(texture: np.ndarray, uvs: np.ndarray) -> np.ndarray:
    """Return the bilinear, linear RGB values, shape (n, 3), of an sRGB texture at ``uvs``, (n, 2).

    Texels are averaged in linear light; coordinates repeat, and v = 0 is the bottom row. ``texture`` has
    shape (height, width, 3), uint8.
    """
    height, width = texture.shape[:2]
    decode = linear_from_srgb(np.arange(256) / 255.0)
    turns = uvs.astype(np.float64) - np.floor(uvs.astype(np.float64))
    x = turns[:, 0] * width - 0.5
    y = (1.0 - turns[:, 1]) * height - 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    right_share, low_share = (x - left)[:, None], (y - top)[:, None]

    def texels(row: np.ndarray, column: np.ndarray) -> np.ndarray:
        return decode[texture[row % height, column % width, :3]]

    upper = (1 - right_share) * texels(top, left) + right_share * texels(top, left + 1)
    lower = (1 - right_share) * texels(top + 1, left) + right_share * texels(top + 1, left + 1)
    return (1 - low_share) * upper + low_share * lower


def join_scenes(*scenes: Scene) -> Scene:
    """Return all triangles in one scene; the objects are numbered through, in the order of the scenes.

    Args:
        scenes: at least one; where they are does not change.

    Raises:
        DigsError: more objects than eight bits can number.
    """
    vertices = _starts([len(scene.vertices) for scene in scenes])
    materials = _starts([len(scene.materials) for scene in scenes])
    objects = _starts([int(scene.face_objects.max()) for scene in scenes])
    if sum(int(scene.face_objects.max()) for scene in scenes) > MOST_OBJECTS:
        raise DigsError(f"scene: more than {MOST_OBJECTS} objects; leave some out")
    numbers = [
        np.where(scene.face_objects == FURNITURE, FURNITURE, scene.face_objects + start)
        for scene, start in zip(scenes, objects, strict=True)
    ]
    return Scene(
        vertices=np.concatenate([scene.vertices for scene in scenes]),
        faces=_shifted([scene.faces for scene in scenes], vertices),
        face_materials=_shifted([scene.face_materials for scene in scenes], materials),
        normals=np.concatenate([scene.normals for scene in scenes]),
        uvs=np.concatenate([scene.uvs for scene in scenes]),
        vertex_colors=np.concatenate([scene.vertex_colors for scene in scenes]),
        materials=tuple(material for scene in scenes for material in scene.materials),
        face_objects=np.concatenate(numbers).astype(np.int32),
        objects=tuple(each for scene in scenes for each in scene.objects),
    )


def only_object(scene: Scene, number: int) -> Scene:
    """Return one object alone, for its outline: without textures other than those that make holes."""
    kept = scene.faces[scene.face_objects == number]
    used, faces = np.unique(kept, return_inverse=True)
    return Scene(
        vertices=scene.vertices[used],
        faces=faces.reshape(-1, 3).astype(np.int32),
        face_materials=scene.face_materials[scene.face_objects == number],
        normals=scene.normals[used],
        uvs=scene.uvs[used],
        vertex_colors=scene.vertex_colors[used],
        materials=tuple(map(_outline_material, scene.materials)),
    )


def _outline_material(material: Material) -> Material:
    return replace(
        material,
        texture=None,
        finish_texture=None,
        transmission_texture=None,
        emission_texture=None,
        normal_texture=None,
    )


def _starts(counts: list[int]) -> list[int]:
    return np.cumsum([0, *counts])[:-1].tolist()


def _shifted(parts: list[np.ndarray], starts: list[int]) -> np.ndarray:
    """Return indices of several scenes as those of the joined one, int32."""
    shifted = [part + start for part, start in zip(parts, starts, strict=True)]
    return np.concatenate(shifted).astype(np.int32)
