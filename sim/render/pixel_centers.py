"""What lies at the pixel centers of an image: one ray each, without light."""

# Warp's type hints take the dtype of an array for a value, and structs for functions.
# pyright: reportArgumentType=false, reportGeneralTypeIssues=false

from typing import Any

import warp as wp

from digs_warp.camera import Camera
from digs_warp.device.parallel import launch_parallel
from digs_warp.sim.render.kernels import geometry_kernel
from digs_warp.sim.render.protocol import Geometry
from digs_warp.sim.render.view import make_view
from digs_warp.sim.surround import Surround


def geometry_at_pixel_centers(
    surface: Any, camera: Camera, surround: Surround, threads: int = 0
) -> Geometry:
    """Return what a camera sees.

    Args:
        surface: a `digs_warp.sim.render.surface.Surface`.
        camera: inside the surround.
        surround: around the surface.
        threads: CPU threads; 0 means all cores.
    """
    height, width = camera.intrinsics.height, camera.intrinsics.width
    depth = wp.empty(height * width, dtype=float, device="cpu")
    normals = wp.empty(height * width, dtype=wp.vec3, device="cpu")
    materials = wp.empty(height * width, dtype=int, device="cpu")
    objects = wp.empty(height * width, dtype=int, device="cpu")
    inputs = [make_view(camera, surround), surface, depth, normals, materials, objects]
    launch_parallel(geometry_kernel, height * width, inputs, threads=threads)
    return Geometry(
        depth.numpy().reshape(height, width),
        normals.numpy().reshape(height, width, 3),
        materials.numpy().reshape(height, width),
        objects.numpy().reshape(height, width),
    )
