"""Materials with another roughness and color, as if the same object had been made in another finish."""

import colorsys
from dataclasses import replace

import numpy as np

from digs_warp.sim.scene.builtin.plain_shapes import random_finish
from digs_warp.sim.scene.builtin.table import TABLE_TOP
from digs_warp.sim.scene.look_settings import LookSettings, of_object
from digs_warp.sim.scene.scene import FURNITURE, Material, Scene

FULL_TEXEL = 255

# Identifies the table top in the seeds.
TABLE = 303

# Sides of its texture: 1.4 mm per texel on a desk.
TABLE_TEXELS = 1024


def refinished(scene: Scene, look: LookSettings) -> Scene:
    """Return the scene with the finish that the settings ask for; metal stays metal."""
    if not (look.roughness_factor or look.tint):
        return scene
    finished = (
        material if owner == FURNITURE else _of_object(material, owner - 1, look)
        for material, owner in zip(scene.materials, _owners(scene), strict=True)
    )
    return replace(scene, materials=tuple(finished))


def with_table_top(scene: Scene, look: LookSettings, seed: int) -> Scene:
    """Return the scene with the table top that the settings ask for."""
    if look.table_top == "oak":
        return scene
    new = random_finish(np.random.default_rng([seed, TABLE]), TABLE_TEXELS)
    materials = (
        replace(new, name=TABLE_TOP)
        if material.name == TABLE_TOP and owner == FURNITURE
        else material
        for material, owner in zip(scene.materials, _owners(scene), strict=True)
    )
    return replace(scene, materials=tuple(materials))


def tint_color(strength: float, hue: float) -> np.ndarray:
    """Return the factors of a tint on linear red, green and blue, (3,), in 0..1.

    Args:
        strength: 0 (none) to 1 (nothing but the hue).
        hue: [degree]; 0 red, 120 green, 240 blue.
    """
    return 1 - strength * (1 - np.array(colorsys.hsv_to_rgb(hue / 360 % 1.0, 1.0, 1.0)))


def _owners(scene: Scene) -> list[int]:
    """Return the number of the object of each material: no two share one, each brings its own."""
    owners = np.full(len(scene.materials), FURNITURE, np.int64)
    owners[scene.face_materials] = scene.face_objects
    return owners.tolist()


def _of_object(material: Material, number: int, look: LookSettings) -> Material:
    """Return a material of an object, counted from 0."""
    color = tint_color(of_object(look.tint, number, 0.0), of_object(look.tint_hue, number, 0.0))
    return _finished(material, of_object(look.roughness_factor, number, 1.0), color)


def _finished(material: Material, factor: float, color: np.ndarray) -> Material:
    finish = material.finish_texture
    if finish is not None and factor != 1:
        roughness = np.minimum(np.rint(finish[..., 0] * factor), FULL_TEXEL)
        finish = np.stack([roughness.astype(np.uint8), finish[..., 1]], axis=-1)
    return replace(
        material,
        base_color=(material.base_color * color).astype(np.float32),
        roughness=min(material.roughness * factor, 1.0),
        finish_texture=finish,
    )
