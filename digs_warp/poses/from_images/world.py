"""Where the world's axes lie: structure from motion leaves that open, up to a rigid motion in metres."""

from collections.abc import Sequence

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.viewpoints import upward
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import rigid
from digs_warp.poses.from_images.evaluate import umeyama


def world_as_recorded(cameras: Sequence[Camera], recorded: Sequence[Camera]) -> np.ndarray:
    """Return the rigid motion, (4, 4), that lays metric cameras over the recorded ones as well as one can.

    It changes no distance, so nothing is learnt from the recorded poses but where the axes lie.

    Raises:
        DigsError: fewer than three cameras, or cameras on one line.
    """
    found = np.array([camera.center_world for camera in cameras])
    expected = np.array([camera.center_world for camera in recorded])
    rotation = umeyama(found, expected).rotation
    return rigid(rotation, expected.mean(axis=0) - rotation @ found.mean(axis=0))


def upright_world(cameras: Sequence[Camera], center: np.ndarray) -> np.ndarray:
    """Return the rigid motion, (4, 4), to a world with z up and ``center`` at the origin.

    The first camera lies above the negative y axis.

    Raises:
        DigsError: the cameras are turned about their axes in all directions: there is no up.
    """
    z = upward(cameras)
    if z is None:
        raise DigsError(
            "estimated poses: the images are turned in all directions, so nothing tells where up is; "
            "give the recording's poses, or leave out the images that are turned"
        )
    ahead = center - cameras[0].center_world
    y = ahead - (ahead @ z) * z
    # Straight above the center any direction will do.
    y = y if np.linalg.norm(y) > 1e-9 else cameras[0].world_from_cam[:3, 0]
    y = y - (y @ z) * z
    y /= np.linalg.norm(y)
    rotation = np.stack([np.cross(y, z), y, z])
    return rigid(rotation, -rotation @ center)
