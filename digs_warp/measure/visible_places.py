# Kernels are typed by Warp, whose stubs pyright cannot follow:
# pyright: reportAttributeAccessIssue=false, reportOperatorIssue=false, reportInvalidTypeForm=false
# pyright: reportArgumentType=false
"""Which places on a surface cameras see: in an image, not edge-on, and with nothing in front of them."""

from collections.abc import Sequence

import numpy as np
import warp as wp

from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.camera import Camera

# The surface hides a place from this share of the distance on: the place itself is on the surface, too.
BEFORE = wp.constant(0.999)
# A surface at less than 10 degrees to the line of sight is hardly a pixel wide: this is the sine.
EDGE_ON = 0.17


def visible_places(
    places_world: np.ndarray,
    normals_world: np.ndarray,
    surface: TriangleMesh,
    cameras: Sequence[Camera],
) -> np.ndarray:
    """Return which places at least one camera sees, shape (n,), bool.

    Args:
        places_world: on the surface [m], shape (n, 3).
        normals_world: of the surface there, to either side, shape (n, 3).
        surface: what can hide them; both sides of its triangles do.
        cameras: where they are looked at from.
    """
    visible = np.zeros(len(places_world), dtype=bool)
    mesh = wp.Mesh(
        points=wp.array(np.ascontiguousarray(surface.points_world), dtype=wp.vec3, device="cpu"),
        indices=wp.array(surface.triangles.ravel(), dtype=int, device="cpu"),
    )
    for camera in cameras:
        px, z = camera.project(places_world)
        k = camera.intrinsics
        with np.errstate(invalid="ignore"):
            inside = (z > 0) & np.all((px >= 0) & (px < [k.width, k.height]), axis=1)
        toward = places_world - camera.center_world
        across = np.abs(np.einsum("ij,ij->i", toward, normals_world))
        faced = across >= EDGE_ON * np.linalg.norm(toward, axis=1)
        asked = np.flatnonzero(inside & faced & ~visible)
        if not len(asked):
            continue
        places = np.ascontiguousarray(places_world[asked], dtype=np.float32)
        clear = wp.zeros(len(asked), dtype=wp.bool, device="cpu")
        center = wp.vec3(*camera.center_world.tolist())
        inputs = [mesh.id, center, wp.array(places, dtype=wp.vec3, device="cpu"), clear]
        launch_parallel(_clear_kernel, len(asked), inputs)
        visible[asked] = clear.numpy()
    return visible


@wp.kernel(enable_backward=False)
def _clear_kernel(
    first: int,
    mesh: wp.uint64,
    center: wp.vec3,
    places: wp.array(dtype=wp.vec3),
    clear: wp.array(dtype=wp.bool),
):
    """Say whether nothing lies between the center and a place."""
    i = first + wp.tid()
    toward = places[i] - center
    reach = BEFORE * wp.length(toward)
    clear[i] = not wp.mesh_query_ray_anyhit(mesh, center, wp.normalize(toward), reach)
