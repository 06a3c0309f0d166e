"""Scenes laid out as those that real depth cameras were measured on, seen by a camera at rest."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.camera.walk.walk import Walk
from digs_warp.sim.config import SimulateConfig, Tier
from digs_warp.sim.record.sensor_plan import plan_for_facts
from digs_warp.sim.record.session import Session
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import Material, Scene
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.facts import measure_facts
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.tiers import depth_of, sense

WHITE = Material("white", np.full(3, 0.8), roughness=1.0)
MATERIALS = {
    "white": WHITE,
    "black": Material("black", np.full(3, 0.05), roughness=1.0),
    "cardboard": Material("cardboard", np.array([0.5, 0.36, 0.22]), roughness=0.9),
    "reflective": Material("reflective", np.full(3, 0.6), roughness=0.15),
    "transparent": Material("transparent", np.ones(3), roughness=0.05, transmission=0.9),
}
WIDE = 10.0  # of a board to each side [m]; no camera sees its ends
ROOM = 0.7  # mean radiance of the built-in room


@dataclass(frozen=True)
class AtRest:
    """A walk that does not move: the camera looks along z from the origin."""

    end = 10.0  # [s]

    def pose(self, moment: float) -> np.ndarray:
        """The pose at any time, (4, 4)."""
        return np.eye(4)

    def motion(self, moment: float) -> tuple[np.ndarray, np.ndarray]:
        """No velocity."""
        return np.zeros(3), np.zeros(3)


def board(
    distance: float,
    material: Material = WHITE,
    tilt_deg: float = 0.0,
    right: float = WIDE,
) -> Scene:
    """Return a board across the view, turned about the vertical, that ends ``right`` of the middle [m]."""
    tilt = np.deg2rad(tilt_deg)
    along = np.array([np.cos(tilt), 0.0, np.sin(tilt)])
    middle = np.array([0.0, 0.0, distance])
    across = [middle - WIDE * along, middle + right * along]
    down = np.array([0.0, WIDE, 0.0])
    corners = np.array([across[0] + down, across[1] + down, across[1] - down, across[0] - down])
    return Scene(
        vertices=corners.astype(np.float32),
        faces=np.array([[0, 2, 1], [0, 3, 2]], np.int32)[:, ::-1].copy(),
        face_materials=np.zeros(2, np.int32),
        normals=np.tile([np.sin(tilt), 0.0, -np.cos(tilt)], (4, 1)).astype(np.float32),
        uvs=np.zeros((4, 2), np.float32),
        vertex_colors=np.ones((4, 3), np.float32),
        materials=(material,),
    )


def both(first: Scene, second: Scene) -> Scene:
    """Return a scene of two boards."""
    count, materials = len(first.vertices), len(first.materials)
    return Scene(
        vertices=np.concatenate([first.vertices, second.vertices]),
        faces=np.concatenate([first.faces, second.faces + count]),
        face_materials=np.concatenate([first.face_materials, second.face_materials + materials]),
        normals=np.concatenate([first.normals, second.normals]),
        uvs=np.concatenate([first.uvs, second.uvs]),
        vertex_colors=np.concatenate([first.vertex_colors, second.vertex_colors]),
        materials=first.materials + second.materials,
    )


@dataclass(frozen=True, eq=False)
class Still:
    """A scene before a camera at rest.

    Attributes:
        truth: of the left eye.
        session: that rendered it.
    """

    truth: FrameTruth
    session: Session

    @property
    def rig(self) -> StereoRig:
        """The camera."""
        return self.truth.rig

    def depths(self, tier: Tier, frames: int) -> Iterator[np.ndarray]:
        """Yield the depth of frames as the left eye has it [m], (height, width), NaN where there is none."""
        plan = plan_for_facts(measure_facts([self.truth], self.rig), self.rig, self.session.config)
        for number in range(frames):
            frame = replace(self.truth, number=number)
            is_gray = self.rig.has_color_camera
            pair = recorded_images(frame, plan.pixel_effects, is_gray=is_gray)
            depth = depth_of(sense(frame, tier, plan.depth, recorded=pair), frame)
            yield np.where(np.isfinite(depth), depth, np.float32(np.nan))


def photographed(scene: Scene, profile: str) -> Still:
    """Return the scene before a camera at rest, at the native size of a profile, in even light."""
    rig = load_profile(profile).rig()
    environment = Environment(np.full((16, 32, 3), ROOM, np.float32), 30.0)
    config = SimulateConfig(profile=profile, frames=1, samples_per_pixel=4)
    session = Session(
        config, scene, environment, load_profile(profile), rig, cast(Walk, AtRest()),
        RaycastRenderer(scene, environment),
    )  # fmt: skip
    # The left eye stands at the origin, wherever the color camera is.
    rig = replace(rig, color_offset=0.0)
    return Still(replace(session, rig=rig).truth(0, Shutter())[0], session)
