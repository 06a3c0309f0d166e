"""From where the Gaussians are looked at first: from around the object, or as the recording began."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.show.film.camera_path import Subject, orbit, same_width_of_view, up_of

WIDTH, FOV_DEG = 640, 45.0
# Directions around the object that are looked at.
SIDES = 48


@dataclass(frozen=True, eq=False)
class FirstView:
    """Where a view in 3D begins.

    Attributes:
        camera: looks at the target.
        target: that the view turns around [m], shape (3,).
        up: what is up in the world, of length 1, shape (3,).
    """

    camera: Camera
    target: np.ndarray
    up: np.ndarray

    def to_json(self) -> dict[str, Any]:
        """Return it for the viewer; ``halfView``: tangent of half the view across the smaller side."""
        k = self.camera.intrinsics
        return {
            "target": self.target.tolist(),
            "eye": self.camera.center_world.tolist(),
            "up": self.up.tolist(),
            "halfView": 0.5 * min(k.width, k.height) / k.fx,
        }


def around(subject: Subject, recorded: Sequence[Camera]) -> FirstView:
    """Look at an object from the side that was recorded first: the other one may not have been seen.

    Args:
        subject: the object.
        recorded: the cameras by time; without any, z is up and the side is that of the x axis.
    """
    k, up = Intrinsics.from_fov(WIDTH, WIDTH * 3 // 4, FOV_DEG), up_of(recorded)
    turn = orbit(subject, k, SIDES if len(recorded) else 1, up=up)
    away = recorded[0].center_world - subject.center_world if len(recorded) else np.zeros(3)
    facing = [float(away @ (camera.center_world - subject.center_world)) for camera in turn]
    return FirstView(turn[int(np.argmax(facing))], subject.center_world, up)


def as_recorded(points: np.ndarray, recorded: Sequence[Camera]) -> FirstView:
    """Look as the first recorded camera, and turn around what of the points, (n, 3), is in its middle."""
    k = same_width_of_view(recorded[0].intrinsics, WIDTH, WIDTH * 3 // 4)
    camera = Camera(k, recorded[0].world_from_cam)
    px, depth = camera.project(points.astype(np.float64))
    seen = (depth > 0) & (px > 0).all(axis=1) & (px < [k.width, k.height]).all(axis=1)
    distance = float(np.median(depth[seen])) if seen.any() else 1.0
    target = camera.center_world + distance * camera.world_from_cam[:3, 2]
    return FirstView(camera, target, up_of(recorded))
