"""Several scenes as one: objects beside each other, furniture under them."""

from dataclasses import replace

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.sim.scene.scene import FURNITURE, MOST_OBJECTS, Material, Scene


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
