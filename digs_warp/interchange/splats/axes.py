"""Turning Gaussians into the frames of other programs: positions, orientations, spherical harmonics."""

from dataclasses import replace

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry import quat_multiply, quat_xyzw_from_matrix
from digs_warp.sh import rotate_sh

# Quarter turns around x, so that positions stay exact. Our world has z up.
# x right, y up, z to the viewer (OpenGL, SPZ, USD): (x, y, z) -> (x, -z, y).
WORLD_FROM_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
# x right, y down, z forward (a camera, most scenes trained from COLMAP): (x, y, z) -> (x, z, -y).
WORLD_FROM_Y_DOWN = WORLD_FROM_Y_UP.T

# Which axis of a file points up -> the rotation that brings it into our world.
WORLD_FROM_UP = {"z": np.eye(3), "y": WORLD_FROM_Y_UP, "-y": WORLD_FROM_Y_DOWN}


def turned(gaussians: Gaussians, b_from_a: np.ndarray) -> Gaussians:
    """Return the Gaussians of frame a in frame b, a rotation (3, 3); quaternions become unit ones.

    A zero quaternion is no rotation. Values that are not finite stay so.
    """
    quats = gaussians.quats.astype(np.float64)
    norms = np.linalg.norm(quats, axis=1, keepdims=True)
    quats = np.where(norms == 0, (0.0, 0.0, 0.0, 1.0), quats / np.where(norms == 0, 1.0, norms))
    with np.errstate(invalid="ignore", over="ignore"):
        return replace(
            gaussians,
            means=gaussians.means @ b_from_a.T.astype(np.float32),
            quats=quat_multiply(quat_xyzw_from_matrix(b_from_a), quats),
            sh=rotate_sh(gaussians.sh, b_from_a),
        )
