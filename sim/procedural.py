"""The built-in object: a glazed vase dressed in a kilim, tied with a cord, under a thin brass handle.

Made by code alone, and made to test a reconstruction: fine woven texture with folds, a plain matte bowl
without any texture, a glossy glaze, and a handle only a few millimetres thick.
"""

from dataclasses import replace

import numpy as np

from digs_warp.sim.builtin.dress import BOWL_OUTLINE, NECK_OUTLINE, cloth_patch, cord_patch
from digs_warp.sim.builtin.finishes import fibre_texture, glaze_texture, walnut_texture
from digs_warp.sim.builtin.kilim import kilim_texture
from digs_warp.sim.builtin.shapes import (
    Patch,
    angles,
    arc_length,
    grid_uvs,
    join_patches,
    revolve,
    smooth_curve,
    tube,
)
from digs_warp.sim.scene import Material, Scene

SEED = 7

# Longest edge of the bounding box [m]: the size to which loaded meshes are scaled, too.
SIZE = 0.5

# Sides of the rings of the turned parts.
SEGMENTS = 84

# Outline of the turned foot, (radius, z) [m], upward along the outside.
FOOT_OUTLINE = np.array(
    [
        (0.0, 0.0),
        (0.04, 0.0),
        (0.078, 0.0),
        (0.0815, 0.0025),
        (0.0815, 0.008),
        (0.077, 0.011),
        (0.0745, 0.014),
        (0.077, 0.018),
        (0.0785, 0.022),
        (0.0765, 0.0265),
        (0.072, 0.028),
        (0.05, 0.0285),
    ]
)
# Brass and cane [m]: the collar under the lip with a loop on either side, and the handle in them.
COLLAR_RADIUS = 0.0455
COLLAR_HEIGHT = 0.333
LOOP_RADIUS = 0.0065
WIRE_RADIUS = 0.0024
GRIP_RADIUS = 0.0062
CANE_WIDTH = 0.0042

# (x, z) of the handle from a loop to the top [m]; the other half is its mirror image.
HANDLE_POINTS = (
    (0.0540, 0.3290),
    (0.0590, 0.3285),
    (0.0680, 0.3400),
    (0.0830, 0.3750),
    (0.0930, 0.4150),
    (0.0870, 0.4550),
    (0.0600, 0.4830),
    (0.0000, 0.4940),
)


def procedural_scene() -> Scene:
    """Return the built-in object, always the same: 0.5 m tall, centred on the origin."""
    rng = np.random.default_rng(SEED)
    neck_profile = smooth_curve(NECK_OUTLINE, 40)
    lip = neck_profile[:, 1].argmax()
    walnut = walnut_texture(rng, smooth_curve(FOOT_OUTLINE, 256))
    neck = revolve(neck_profile, SEGMENTS)
    glaze = glaze_texture(rng, rim_v=neck.uvs[lip * (SEGMENTS + 1), 1])
    brass = Material("brass", _linear(0.80, 0.55, 0.24), roughness=0.28, metallic=1.0)
    parts = [
        (_foot(), _textured("walnut", walnut, 0.45)),
        (_bowl(), Material("bisque", _linear(0.70, 0.62, 0.50), roughness=0.9)),
        (neck, _textured("glaze", glaze, 0.15)),
        (cloth_patch(), _textured("kilim", kilim_texture(rng), 0.95)),
        (cord_patch(), _textured("cord", fibre_texture(rng, slant=2), 0.85)),
        (_brass_wire(), brass),
        (_grip(), _textured("cane", fibre_texture(rng, slant=0), 0.6)),
    ]
    return _scene([patch for patch, _ in parts], tuple(material for _, material in parts))


def _linear(red: float, green: float, blue: float) -> np.ndarray:
    return np.array((red, green, blue), np.float32)


def _textured(name: str, texture: np.ndarray, roughness: float) -> Material:
    return Material(name, np.ones(3, np.float32), texture, roughness)


def _foot() -> Patch:
    """Return the turned foot; its texture covers the outline from bottom to top exactly once."""
    rows = 28
    patch = revolve(smooth_curve(FOOT_OUTLINE, rows), SEGMENTS)
    uvs = grid_uvs(np.linspace(0, 1, rows), SEGMENTS).reshape(-1, 2)
    return replace(patch, uvs=uvs)


def _bowl() -> Patch:
    return revolve(smooth_curve(BOWL_OUTLINE, 24), SEGMENTS)


def _handle_path() -> np.ndarray:
    """Return the centre line of the handle, from loop to loop over the top, shape (121, 3)."""
    right = np.array(HANDLE_POINTS)
    left = right[-2::-1] * (-1, 1)
    curve = smooth_curve(np.concatenate([right, left]), 121)
    return np.stack([curve[:, 0], np.zeros(len(curve)), curve[:, 1]], axis=1)


def _brass_wire() -> Patch:
    """Return collar, the two loops on it and the handle that hangs in them."""
    circle = angles(SEGMENTS)
    flat_ring = np.stack([np.cos(circle), np.sin(circle), np.zeros_like(circle)], axis=1)
    flat_ring[-1] = flat_ring[0]
    collar = flat_ring * COLLAR_RADIUS + (0, 0, COLLAR_HEIGHT)
    standing_ring = flat_ring[::3, [0, 2, 1]] * LOOP_RADIUS
    middle = (COLLAR_RADIUS + LOOP_RADIUS, 0, COLLAR_HEIGHT)
    loops = [standing_ring * (side, 1, 1) + np.array(middle) * (side, 1, 1) for side in (1, -1)]
    path = _handle_path()
    thickness = np.full((len(path), 1), WIRE_RADIUS)
    thickness[[0, -1]] = 0  # closed ends
    return join_patches(
        [
            tube(collar, 0.0026, 10),
            *(tube(loop, 0.0017, 8) for loop in loops),
            tube(path, thickness, 10),
        ]
    )


def _grip() -> Patch:
    """Return the cane wound round the middle of the handle, each winding a low ridge."""
    path = _handle_path()
    middle = smooth_curve(path[42:79], 170)
    along = arc_length(middle)[:, None]
    ridge = np.abs(np.sin(np.pi * along / CANE_WIDTH))
    radius = GRIP_RADIUS * (0.88 + 0.12 * ridge)
    radius[[0, -1]] = WIRE_RADIUS
    return tube(middle, radius, 12, uv_scale=(0.1, 3.0))


def _scene(patches: list[Patch], materials: tuple[Material, ...]) -> Scene:
    """Join the patches, one material each, and place them in the middle at their size."""
    whole = join_patches(patches)
    low, high = whole.vertices.min(axis=0), whole.vertices.max(axis=0)
    scale = SIZE / (high - low).max()
    count = len(whole.vertices)
    return Scene(
        vertices=((whole.vertices - (low + high) / 2) * scale).astype(np.float32),
        faces=whole.faces.astype(np.int32),
        face_materials=np.repeat(np.arange(len(patches)), [len(p.faces) for p in patches]).astype(
            np.int32
        ),
        normals=whole.normals.astype(np.float32),
        uvs=whole.uvs.astype(np.float32),
        vertex_colors=np.ones((count, 3), np.float32),
        materials=materials,
    )
