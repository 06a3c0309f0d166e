"""The gradient of a view's camera: shares of the Gaussians, summed in a fixed order; and that of a motion."""

from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from digs_warp.checks import check_shape
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import matrix_from_rotation_vector, rigid
from digs_warp.splat.project_adjoint import CAMERA_FIELDS

wp.set_module_options({"enable_backward": False})

# Gaussians whose shares one thread sums.
SUM_BLOCK = 1024

_CAMERA_FIELDS = wp.constant(CAMERA_FIELDS)
_SUM_BLOCK = wp.constant(SUM_BLOCK)


@dataclass(frozen=True, eq=False)
class CameraGradient:
    """dL / d(camera) of one view; the camera moves in its own frame, see `digs_warp.splat.project_adjoint`.

    Attributes:
        rotation: in the rotation vector w [rad], shape (3,).
        translation: in the translation t [m], shape (3,): world_from_cam' = world_from_cam exp(w, t).
        focal: in (fx, fy) [px], shape (2,).
        center: in (cx, cy) [px], shape (2,).
    """

    rotation: np.ndarray
    translation: np.ndarray
    focal: np.ndarray
    center: np.ndarray


class CameraShares:
    """Room for the shares of ``count`` Gaussians; of none, when no gradient of the camera is wanted.

    Attributes:
        array: the shares, (count, CAMERA_FIELDS), as `project_backward_kernel` writes them.
    """

    def __init__(self, count: int, device: str, threads: int) -> None:
        self.array = wp.zeros((count, CAMERA_FIELDS), dtype=float, device=device)
        self._threads = threads
        blocks = -(-count // SUM_BLOCK)
        self._sums = wp.zeros((blocks, CAMERA_FIELDS), dtype=wp.float64, device=device)

    def total(self) -> CameraGradient:
        """Return the sum; zero for no Gaussians."""
        count, device = self.array.shape[0], str(self.array.device)
        inputs = [count, self.array, self._sums]
        launch_parallel(sum_camera_kernel, self._sums.shape[0], inputs, device, self._threads)
        total = self._sums.numpy().sum(axis=0)
        return CameraGradient(total[:3], total[3:6], total[6:8], total[8:10])


@wp.kernel
def sum_camera_kernel(
    first: int,
    count: int,
    camera_shares: wp.array2d[float],  # [count, CAMERA_FIELDS]
    # outputs
    block_sums: wp.array2d[wp.float64],  # [blocks, CAMERA_FIELDS]
):
    """Sum the shares of a block of Gaussians in the order of their index."""
    block = first + wp.tid()
    begin = block * _SUM_BLOCK
    for field in range(_CAMERA_FIELDS):
        total = wp.float64(0.0)
        for g in range(begin, wp.min(begin + _SUM_BLOCK, count)):
            total += wp.float64(camera_shares[g, field])
        block_sums[block, field] = total


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
