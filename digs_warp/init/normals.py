"""Surface normals from a depth map: an extension of the paper, for Gaussians that start flat."""

import numpy as np
import warp as wp

from digs_warp.camera import Camera
from digs_warp.init.edges import on_device
from digs_warp.init.normal_kernel import normal_kernel


def normals_from_depth(camera: Camera, depth: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return unit normals in the world, toward the camera, shape (height, width, 3), float32.

    The normal is the cross product of the two central differences of the back-projected points, over a
    few pixels. Zero where it is not wanted, and where one of the four neighbours is unknown: such pixels
    tell nothing.

    Args:
        camera: of the view.
        depth: planar depth [m], shape (height, width), NaN where unknown.
        wanted: which pixels need a normal, shape (height, width), bool.
    """
    k = camera.intrinsics
    normals = np.zeros((*depth.shape, 3), dtype=np.float32)
    inputs = [
        on_device(np.ascontiguousarray(depth, dtype=np.float32)),
        on_device(np.ascontiguousarray(wanted)),
        wp.mat33(*camera.world_from_cam[:3, :3].ravel()),
        *(float(value) for value in (k.fx, k.fy, k.cx, k.cy)),
    ]
    wp.launch(
        normal_kernel,
        dim=depth.shape[0],
        inputs=inputs,
        outputs=[on_device(normals)],
        device="cpu",
    )
    return normals
