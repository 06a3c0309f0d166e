"""A camera inside its surround, as kernels need it."""

# Kernel code is a language of its own; these checks misread it.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false

import numpy as np
import warp as wp

from digs_warp.camera import Camera
from digs_warp.checks import DigsError

wp.set_module_options({"enable_backward": False})

# Beyond everything [m]; the surround is met analytically.
FAR = wp.constant(1.0e6)


@wp.struct
class View:
    """A camera and its surround."""

    width: int
    fx: float
    fy: float
    cx: float
    cy: float
    world_from_cam: wp.mat33  # rotation
    center: wp.vec3
    surround_radius: float  # [m], sphere around the origin
    pixel_cone: float  # spread of the cone of one sample [rad]


@wp.func
def ray_direction_cam(view: View, x: float, y: float) -> wp.vec3:
    """Unit direction through image position (x, y) [px] in camera axes."""
    return wp.normalize(wp.vec3((x - view.cx) / view.fx, (y - view.cy) / view.fy, 1.0))


@wp.func
def surround_distance(view: View, origin: wp.vec3, direction: wp.vec3) -> float:
    """Distance along the ray to the surrounding sphere, from inside."""
    along = wp.dot(origin, direction)
    gap = view.surround_radius * view.surround_radius - wp.dot(origin, origin)
    root = wp.sqrt(along * along + gap)
    # Two forms of the same root, each without cancellation for one sign of `along`.
    return wp.where(along > 0.0, gap / (root + along), root - along)


def check_inside(camera: Camera, surround_radius: float) -> None:
    """Raise a `DigsError` when the camera stands outside the surround."""
    distance = float(np.linalg.norm(camera.center_world))
    if distance >= surround_radius:
        raise DigsError(
            f"camera: {distance:.3g} m from the origin, outside the surround of radius "
            f"{surround_radius:.3g} m; make the environment larger or come closer"
        )


def make_view(camera: Camera, surround_radius: float, samples_per_pixel: int = 1) -> View:
    """Return the camera for kernels.

    Raises:
        DigsError: the camera stands outside the surround.
    """
    check_inside(camera, surround_radius)
    k = camera.intrinsics
    view = View()
    view.width = k.width
    view.fx, view.fy, view.cx, view.cy = k.fx, k.fy, k.cx, k.cy
    view.world_from_cam = wp.mat33(camera.world_from_cam[:3, :3].astype(np.float32))
    view.center = wp.vec3(*camera.center_world)
    view.surround_radius = surround_radius
    # The samples of a pixel share its area: each answers for a cone of 1 / sqrt(n) of its width.
    view.pixel_cone = 1.0 / (min(k.fx, k.fy) * np.sqrt(samples_per_pixel))
    return view
