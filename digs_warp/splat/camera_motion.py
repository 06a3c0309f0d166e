"""A motion of a camera in its own frame, six numbers, and the gradient of a loss in them."""

from dataclasses import replace

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import matrix_from_rotation_vector
from digs_warp.splat.camera_gradient import CameraGradient


def moved_camera(
    camera: Camera, pose: np.ndarray | None, intrinsics: np.ndarray | None = None
) -> Camera:
    """Return the camera after a motion, and with other intrinsics.

    Args:
        camera: where the motion starts.
        pose: a rotation vector w [rad] and a translation t [m], shape (6,): ``world_from_cam`` becomes
            ``world_from_cam @ [[R(w), t], [0, 1]]``. None: no motion.
        intrinsics: fx, fy, cx, cy [px], shape (4,). None: the camera's.

    Raises:
        DigsError: another shape, or values that no camera has.
    """
    if pose is not None:
        check_shape("pose", pose, (6,))
        motion = np.eye(4)
        motion[:3, :3] = matrix_from_rotation_vector(pose[:3])
        motion[:3, 3] = pose[3:]
        camera = replace(camera, world_from_cam=camera.world_from_cam @ motion)
    if intrinsics is not None:
        check_shape("intrinsics", intrinsics, (4,))
        fx, fy, cx, cy = (float(value) for value in intrinsics)
        camera = replace(camera, intrinsics=replace(camera.intrinsics, fx=fx, fy=fy, cx=cx, cy=cy))
    return camera


def pose_gradient(gradient: CameraGradient, pose: np.ndarray) -> np.ndarray:
    """Return the gradient in ``pose``, shape (6,), from that of the moved camera."""
    turn = pose[:3]
    translation = matrix_from_rotation_vector(turn) @ gradient.translation
    return np.concatenate([rotation_jacobian(turn).T @ gradient.rotation, translation])


def rotation_jacobian(vector: np.ndarray) -> np.ndarray:
    """Return J with R(w + dw) = R(w) R(J dw) to first order, shape (3, 3); w in rad, shape (3,).

    The right Jacobian of SO(3) (Chirikjian 2011, section 10.6.7): with the angle a and the cross-product
    matrix W of w, J = I - (1 - cos a) / a^2 W + (a - sin a) / a^3 W^2.
    """
    x, y, z = np.asarray(vector, dtype=np.float64)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = float(np.sqrt(x * x + y * y + z * z))
    if angle < 1e-4:  # the series, where the quotients cancel
        return np.eye(3) - 0.5 * cross + cross @ cross / 6.0
    first = (1.0 - np.cos(angle)) / angle**2
    second = (angle - np.sin(angle)) / angle**3
    return np.eye(3) - first * cross + second * cross @ cross
