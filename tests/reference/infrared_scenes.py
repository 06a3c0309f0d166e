"""A still camera with an infrared pair before plain walls, and the formulas of its projector in float64."""

from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.camera.walk.walk import Walk
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.session import Session
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import Material, Scene
from digs_warp.sim.sensor.infrared.pair import SPOT, dot_pattern
from reference.plates import plate

WHITE = Material("white", np.full(3, 0.8), roughness=1.0)
ROOM = 0.7  # mean radiance of the built-in room and of most panoramas


@dataclass(frozen=True)
class StillCamera:
    """A walk that does not move: the camera looks along z from the origin."""

    end = 3.0  # [s]

    def pose(self, moment: float) -> np.ndarray:
        return np.eye(4)

    def motion(self, moment: float) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(3), np.zeros(3)


def infrared_rig(width: int = 424, **changes: Any) -> StereoRig:
    """The D435's rig, at half its image size."""
    return replace(load_profile("d435").rig(width), **changes)


def wall(distance: float, material: Material = WHITE, slope: float = 0.0) -> Scene:
    """A wall that fills the view, ``slope`` metres farther for each metre to the right."""
    size = 3.0 * distance
    return plate((0, 0, distance), (size, 0, slope * size), (0, -size, 0), material)


def still_session(scene: Scene, rig: StereoRig, radiance: float = ROOM) -> Session:
    """A session before a scene in even light; it has no texture."""
    environment = Environment(np.full((16, 32, 3), radiance, np.float32), 30.0)
    config = SimulateConfig(profile="d435", frames=3, samples_per_pixel=1, tier="guided")
    walk = cast(Walk, StillCamera())
    renderer = RaycastRenderer(scene, environment)
    return Session(config, scene, environment, load_profile("d435"), rig, walk, renderer)


def dots_of_pattern() -> np.ndarray:
    """x, y and brightness of every dot, (n, 3), float64."""
    dots = dot_pattern().dots.astype(np.float64)
    return dots[dots[..., 2] > 0]


def spots_at(x: np.ndarray, y: np.ndarray, focal: float) -> np.ndarray:
    """Brightness of the pattern at places of its plane, (n,): Gaussian dots, widened by the pixel."""
    variance = SPOT**2 + 1 / (12 * focal**2)
    dots = dots_of_pattern()
    light = np.zeros(len(x))
    for i in range(len(x)):
        away = (dots[:, 0] - x[i]) ** 2 + (dots[:, 1] - y[i]) ** 2
        light[i] = np.sum(dots[:, 2] * np.exp(-away / (2 * variance)))
    return light * SPOT**2 / variance


def matte_share(albedo: float, light_cosine: float, eye_cosine: float, half_cosine: float) -> float:
    """Light that a dielectric of roughness 1 sends on, over a white matte one: base and coat."""
    fresnel = 0.04 + 0.96 * (1 - half_cosine) ** 5
    # Roughness 1: the normals of the facets are spread evenly, D = 1 / pi; Smith's G = 4 l e / (1+l)(1+e).
    coat = fresnel / ((1 + light_cosine) * (1 + eye_cosine))
    return ((1 - fresnel) * albedo + coat) * light_cosine
