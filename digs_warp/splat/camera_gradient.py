"""The gradient of a view's camera, from that of its Gaussians; and that of a motion.

A camera that moves sees what it would see of a scene that moves the other way, centers, axes and colors
alike. So the gradient in its pose is that of the Gaussians along such a motion.
"""

from dataclasses import replace

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import matrix_from_rotation_vector, quat_multiply, rigid
from digs_warp.geometry.sh import degree_from_count, sh_rotation

# Central differences of a rotation of the color [rad].
_STEP = 1e-4


def camera_gradient(gaussians: Gaussians, gradients: Gaussians, camera: Camera) -> np.ndarray:
    """Return the gradient of the camera that saw ``gaussians``, whose ``gradients`` are given, shape (6,).

    In a rotation vector w [rad] and a translation t [m] in its own frame: world_from_cam exp(w, t).
    """
    of_means = gradients.means.astype(np.float64)
    arms = gaussians.means - camera.center_world
    turn = np.cross(arms, of_means).sum(axis=0)
    products = np.einsum("nkc,njc->kj", gradients.sh.astype(np.float64), gaussians.sh)
    degree = degree_from_count(gaussians.sh.shape[1])
    for number, axis in enumerate(np.eye(3)):
        turned = quat_multiply(np.append(0.5 * axis, 0.0), gaussians.quats)
        turn[number] += (gradients.quats * turned).sum()
        ahead, back = (
            sh_rotation(matrix_from_rotation_vector(step * axis), degree)
            for step in (_STEP, -_STEP)
        )
        turn[number] += (products * (ahead - back)).sum() / (2 * _STEP)
    cam_from_world = camera.cam_from_world[:3, :3]
    return np.concatenate([-cam_from_world @ turn, -cam_from_world @ of_means.sum(axis=0)])


def moved_camera(camera: Camera, pose: np.ndarray) -> Camera:
    """Return the camera after a motion in its own frame.

    Args:
        camera: where the motion starts.
        pose: a rotation vector w [rad] and a translation t [m], shape (6,): ``world_from_cam`` becomes
            ``world_from_cam @ [[R(w), t], [0, 1]]``.

    Raises:
        DigsError: another shape.
    """
    check_shape("pose", pose, (6,))
    motion = rigid(matrix_from_rotation_vector(pose[:3]), pose[3:])
    return replace(camera, world_from_cam=camera.world_from_cam @ motion)


def pose_gradient(gradient: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return the gradient in ``pose`` from that of the moved camera, shape (6,) each."""
    turn = pose[:3]
    translation = matrix_from_rotation_vector(turn) @ gradient[3:]
    return np.concatenate([rotation_jacobian(turn).T @ gradient[:3], translation])


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
