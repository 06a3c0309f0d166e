"""A scene that provokes every error of a stereo depth camera at once, for the pictures of docs/sensor.md.

On a textured table before a textured wall: a pole in front of everything, plain and faintly patterned
cards, a board seen along its surface, a glossy ball and a glossy tile, a mirror, a pane of glass, a lamp,
a black card, a bead close to the lens, and a surround beyond the camera's range.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter

from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.builtin import builtin_environment
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import Material, Scene
from digs_warp.sim.sensor.frame import FrameTruth, Motion
from digs_warp.study.engine.case import STUDIED_CAMERA

WIDTH, HEIGHT, FOV_DEG = 640, 400, 62.0
SURROUND_RADIUS = 25.0  # [m], beyond the 20 m of the camera
SAMPLES = 12
TEXTURE_SIZE = 512  # [px]
RIGHT_SEED = 2  # of the right eye's pixel sampling

EYE, TARGET = np.array([0.0, -1.25, 0.28]), np.array([0.02, 0.1, 0.02])

# A brisk turn of the hand, so that motion shows in a single frame.
MOTION = Motion((0.25, 0.0, 0.0), (0.0, 0.6, 0.0))


class Patch(NamedTuple):
    """A piece of surface; faces are counterclockwise from outside."""

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray


Part = tuple[Patch, Material]
Color = tuple[float, float, float]


def still_life() -> tuple[Scene, Environment]:
    """Return the scene and its surround, always the same."""
    rng = np.random.default_rng(3)
    parts: list[Part] = [
        (card((0.1, 0.75, 0.15), (1.05, 0, 0), (0, 0, 0.62)), _noise(rng, "wall", 42, (2, 60))),
        (card((0, 0.0, -0.3), (1.3, 0, 0), (0, 0.75, 0)), _noise(rng, "table", 36, (2, 40))),
        (card((-0.47, 0.35, 0.16), (0.17, 0.03, 0), (0, 0.02, 0.2)), _plain("plain card", 0.62)),
        (card((-0.55, 0.1, -0.16), (0.15, 0.04, 0), (0, 0.02, 0.1)), _noise(rng, "faint card", 1.2, (3, 12))),
        (card((0.62, 0.3, 0.1), (0.15, -0.1, 0), (0, 0, 0.25)), _plain("mirror", 0.95, 0.02, metallic=1.0)),
        (card((0.3, -0.25, -0.12), (0.12, 0.02, 0), (0, 0, 0.16)),
         _plain("glass", (0.78, 0.93, 0.88), 0.02, transmission=0.93)),
        (ball((-0.1, 0.05, -0.16), 0.14), _plain("glossy ball", 0.12, 0.15)),
        (card((0.03, -0.08, -0.295), (0.12, 0.01, 0), (-0.01, 0.06, 0)), _plain("tile", 0.05, 0.1)),
        (card((-0.325, -0.075, -0.17), (-0.025, 0.225, 0), (0, 0, 0.13)),
         _noise(rng, "board", 45, (3, 40), tint=(0.6, 0.75, 1.0))),
        (ball((0.36, 0.45, 0.42), 0.07), _plain("lamp", 0.9, 1.0, emission=(2.0, 2.0, 1.9))),
        (card((0.02, 0.6, 0.36), (0.13, 0, 0), (0, 0, 0.11)), _plain("black card", 0.0003)),
        (card((0.13, -0.45, 0.1), (0.012, 0, 0), (0, 0, 0.45)),
         _noise(rng, "pole", 60, (4, 60), tint=(1.0, 0.75, 0.4))),
        (ball((-0.115, -1.045, 0.155), 0.022),
         _noise(rng, "near bead", 50, (8, 120), tint=(0.5, 0.9, 0.6))),
    ]  # fmt: skip
    return _join(parts), Environment(builtin_environment().radiance, SURROUND_RADIUS)


def still_life_rig() -> StereoRig:
    """Return a ZED-2-class camera at the size of the pictures."""
    rig = load_profile(STUDIED_CAMERA).rig(WIDTH, HEIGHT)
    return replace(rig, intrinsics=Intrinsics.from_fov(WIDTH, HEIGHT, FOV_DEG))


def photograph(renderer: RaycastRenderer, scene: Scene, rig: StereoRig) -> FrameTruth:
    """Return what the rig sees of the scene, before the sensor."""
    camera = Camera(rig.intrinsics, look_at(EYE, TARGET, np.array([0.0, 0.0, 1.0])))
    image, _ = renderer.render_image(camera, SAMPLES, seed=1)
    view = renderer.render_geometry(camera)
    right, _ = renderer.render_image(camera.shifted_right(rig.baseline), SAMPLES, RIGHT_SEED)
    return FrameTruth(
        number=0,
        camera=camera,
        rig=rig,
        image=image,
        right=right,
        depth=view.depth,
        normals_world=view.normals_world,
        material_ids=view.material_ids,
        materials=scene.materials,
        motion=MOTION,
        rays=renderer.frame_rays(camera, rig.baseline),
    )


def card(center: Sequence[float], right: Sequence[float], up: Sequence[float]) -> Patch:
    """Return a flat piece, ``center`` +- ``right`` +- ``up``, its texture once across."""
    c, r, u = (np.asarray(vector, np.float64) for vector in (center, right, up))
    normal = np.cross(r, u) / np.linalg.norm(np.cross(r, u))
    return Patch(
        vertices=np.stack([c - r - u, c + r - u, c + r + u, c - r + u]),
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
        normals=np.tile(normal, (4, 1)),
        uvs=np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]),
    )


def ball(center: Sequence[float], radius: float) -> Patch:
    """Return a sphere."""
    v, u = (each.ravel() for each in np.mgrid[0:1:49j, 0:1:97j])
    polar, azimuth = np.pi * (v - 0.5), 2 * np.pi * u
    ring = np.cos(polar)
    normals = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), np.sin(polar)], axis=1)
    a = (97 * np.arange(48)[:, None] + np.arange(96)).ravel()
    # At the poles one of the two triangles has no area.
    lower, upper = np.stack([a, a + 1, a + 98], 1)[96:], np.stack([a, a + 98, a + 97], 1)[:-96]
    uvs = np.stack([u, v / 2], axis=1)
    return Patch(center + radius * normals, np.concatenate([lower, upper]), normals, uvs)


def _noise(
    rng: np.random.Generator,
    name: str,
    contrast: float,
    wavelengths: tuple[float, float],
    tint: Color = (0.9, 0.85, 0.8),
) -> Material:
    """Return a matte material with a random texture of the given contrast [DN]."""
    shape = (TEXTURE_SIZE, TEXTURE_SIZE)
    noise = rng.standard_normal(shape)
    # Between both wavelengths; periodic.
    fine, coarse = (gaussian_filter(noise, each / 4, mode="wrap") for each in wavelengths)
    gray = 140 + contrast * (fine - coarse) / np.std(fine - coarse)
    texture = np.clip(gray[..., None] * np.array(tint), 0, 255).astype(np.uint8)
    return Material(name, np.ones(3, np.float32), texture, roughness=0.95)


def _plain(name: str, level: float | Color, roughness: float = 0.95, **kind: Any) -> Material:
    """Return a material of one gray level or color, and of another kind than matte."""
    return Material(name, np.full(3, level, np.float32), roughness=roughness, **kind)


def _join(parts: Sequence[Part]) -> Scene:
    patches = [patch for patch, _ in parts]
    starts = np.cumsum([0, *(len(patch.vertices) for patch in patches)])
    faces = [patch.faces + start for patch, start in zip(patches, starts[:-1], strict=True)]
    vertices, normals, uvs = (
        np.concatenate([getattr(patch, name) for patch in patches]).astype(np.float32)
        for name in ("vertices", "normals", "uvs")
    )
    return Scene(
        vertices=vertices,
        faces=np.concatenate(faces).astype(np.int32),
        face_materials=np.repeat(np.arange(len(parts)), [len(f) for f in faces]).astype(np.int32),
        normals=normals,
        uvs=uvs,
        vertex_colors=np.ones_like(vertices),
        materials=tuple(material for _, material in parts),
    )
