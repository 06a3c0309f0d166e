"""What lies at the pixel centers of an image: one ray each, without light."""

from typing import Any

import warp as wp

from digs_warp.device.kernel_options import ray_module_options
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.camera import Camera
from digs_warp.sim.render.surface import (
    ANY_SURFACE,
    Surface,
    is_see_through,
    opacity_at,
    passes_by,
    texture_level,
    trace,
    viewer_side_normal,
)
from digs_warp.sim.render.surround import boundary_distance, boundary_normal
from digs_warp.sim.render.view import FAR, View, center_ray, make_view
from digs_warp.sim.render.views import Geometry
from digs_warp.sim.scene.environment import Surround

wp.set_module_options(ray_module_options())


@wp.kernel
def _geometry_kernel(
    first: int,
    view: View,
    surface: Surface,
    # outputs
    depth: wp.array[float],  # [pixels] planar z [m]
    normals: wp.array[wp.vec3],  # [pixels] world, toward the viewer
    materials: wp.array[int],  # [pixels] -1: surround
    objects: wp.array[int],  # [pixels] 0: surround or furniture
):
    """Cast one ray through the exact center of a pixel."""
    pixel = first + wp.tid()
    direction_cam = center_ray(view, pixel)
    direction = view.world_from_cam * direction_cam
    start = wp.float32(0.0)
    # With a reach of 0 the query ends at once.
    is_empty = passes_by(surface.radius, view.center, direction, 0.0)
    hit = wp.mesh_query_ray(surface.mesh, view.center, direction, wp.where(is_empty, 0.0, FAR))
    if hit.result and is_see_through(surface, hit):
        level = texture_level(surface, hit, direction, hit.t * view.pixel_cone)
        if opacity_at(surface, hit, level) == 0.0:
            # A hole: continue to the first solid surface.
            distance = trace(surface, view.center, direction, FAR, view.pixel_cone, ANY_SURFACE)
            start = wp.where(distance < 0.0, FAR, distance - 0.5 * surface.step)
            hit = wp.mesh_query_ray(surface.mesh, view.center + start * direction, direction, FAR)
    if hit.result:
        depth[pixel] = (start + hit.t) * direction_cam[2]
        normals[pixel] = viewer_side_normal(surface, hit, direction)
        materials[pixel] = surface.materials[hit.face]
        objects[pixel] = surface.objects[hit.face]
    else:
        distance = boundary_distance(view.boundary, view.center, direction)
        depth[pixel] = distance * direction_cam[2]
        normals[pixel] = boundary_normal(view.boundary, view.center + distance * direction)
        materials[pixel] = -1
        objects[pixel] = 0


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
    launch_parallel(_geometry_kernel, height * width, inputs, threads=threads)
    return Geometry(
        depth.numpy().reshape(height, width),
        normals.numpy().reshape(height, width, 3),
        materials.numpy().reshape(height, width),
        objects.numpy().reshape(height, width),
    )
