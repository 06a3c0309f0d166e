"""The world of found poses: that of the recording, of a turntable, or an upright one."""

from collections.abc import Sequence

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.viewpoints import upward
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import laid_over, rigid, turn_degrees
from digs_warp.poses import thresholds


def world_as_recorded(cameras: Sequence[Camera], recorded: Sequence[Camera]) -> np.ndarray:
    """Return the rigid motion, (4, 4), that lays metric cameras over the recorded ones as well as one can.

    It changes no distance, so nothing is learnt from the recorded poses but where the axes lie.

    Raises:
        DigsError: fewer than three cameras, or cameras on one line.
    """
    found, expected = (np.array([c.center_world for c in some]) for some in (cameras, recorded))
    check_spread(found, expected)
    return laid_over(found, expected)


def check_spread(source: np.ndarray, target: np.ndarray) -> None:
    """Raise a `DigsError` if points (n, 3) that are to be laid over others lie on one line."""
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    singular = np.linalg.svd(b.T @ a, compute_uv=False)
    if len(source) < 3 or singular[1] <= 1e-9 * max(singular[0], 1e-300):
        raise DigsError(
            f"alignment: {len(source)} points on one line or in one place leave the rotation undetermined; "
            "expected at least 3 in a plane"
        )


def on_one_axis(poses: np.ndarray) -> np.ndarray:
    """Return the poses nearest to a turn about one axis, as of a turntable; those given if they are none.

    Before a still camera an object moves by (R, t) from one frame to another, in the axes of the camera.
    The axis is along the turns of all pairs; a point c on it stays: (I - R) c = t (least squares).

    Args:
        poses: ``world_from_cam`` in the world of the object, (n, 4, 4), n >= 3.
    """
    from scipy.spatial.transform import Rotation

    cams = np.linalg.inv(poses)
    motions = (cams[:, None] @ poses[None]).reshape(-1, 4, 4)
    turns = Rotation.from_matrix(motions[:, :3, :3]).as_rotvec()
    axis = np.linalg.svd(turns, full_matrices=False)[2][0]
    still = np.concatenate([*(np.eye(3) - motions[:, :3, :3]), axis[None]])
    center = np.linalg.lstsq(still, np.append(motions[:, :3, 3], 0.0), rcond=None)[0]
    angles = Rotation.from_matrix(motions[:: len(cams), :3, :3]).as_rotvec() @ axis
    turned = np.tile(np.eye(4), (len(cams), 1, 1))
    turned[:, :3, :3] = Rotation.from_rotvec(angles[:, None] * axis).as_matrix()
    turned[:, :3, 3] = center - turned[:, :3, :3] @ center
    firsts = np.linalg.inv(turned) @ cams
    mean = Rotation.from_matrix(firsts[:, :3, :3]).mean().as_matrix()
    found = np.linalg.inv(turned @ rigid(mean, firsts[:, :3, 3].mean(axis=0)))
    far = np.linalg.norm(found[:, :3, 3] - poses[:, :3, 3], axis=1)
    off = turn_degrees(found[:, :3, :3], poses[:, :3, :3])
    near = far.max() < thresholds.MAX_OFF_AXIS * np.linalg.norm(center)
    return found if near and off.max() < thresholds.MAX_OFF_AXIS_DEG else poses


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
