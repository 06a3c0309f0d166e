"""Surface normals from a depth map: an extension of the paper, for Gaussians that start flat."""

import numpy as np

from digs_warp.camera import Camera
from digs_warp.init.uncertainty import pixel_rays

# The tangents reach this many pixels to either side: noise tilts a normal by its ratio to this distance.
REACH = 3


def normals_from_depth(camera: Camera, depth: np.ndarray) -> np.ndarray:
    """Return unit normals in the world, toward the camera, shape (height, width, 3), float32.

    The normal is the cross product of the two central differences of the back-projected points. Zero
    where one of the four neighbours is unknown: such pixels tell nothing.
    """
    points = pixel_rays(camera) * depth.astype(np.float64)[..., None]
    right, down = np.full_like(points, np.nan), np.full_like(points, np.nan)
    right[:, REACH:-REACH] = points[:, 2 * REACH :] - points[:, : -2 * REACH]
    down[REACH:-REACH] = points[2 * REACH :] - points[: -2 * REACH]
    # x right, y down, z forward: down x right points back to the camera.
    normals = np.cross(down, right)
    lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        normals = normals / lengths
    return np.nan_to_num(normals, nan=0.0).astype(np.float32)
