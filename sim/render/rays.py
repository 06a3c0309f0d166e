"""Rays that only some effects of the sensor need; see `digs_warp.sim.sensor.frame.FrameRays`."""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

from functools import cached_property
from typing import Any

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import exact_vector_module_options
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.camera import Camera
from digs_warp.sim.render.surface import ANY_SURFACE, OPAQUE, Surface, trace, viewer_side_normal
from digs_warp.sim.render.upload import DeviceScene
from digs_warp.sim.render.view import FAR, View, make_view, ray_direction_cam, surround_distance
from digs_warp.sim.scene.environment import Surround

# Without Warp's flags, which would inline the traversal wherever a ray is cast: 3 s to compile.
wp.set_module_options(exact_vector_module_options())

# Points along a ray that differ by less than this share of their distance are the same point: float32 hits
# from two eyes differ by a tenth of that.
SAME_POINT = wp.constant(1.0e-4)


@wp.kernel
def right_visibility_kernel(
    first: int,
    view: View,
    surface: Surface,
    pixels: wp.array[int],
    right_center: wp.vec3,
    # outputs
    visible: wp.array[wp.uint8],  # [pixels]
):
    """Look from the right eye at the points that the left eye sees at some pixel centers."""
    index = first + wp.tid()
    pixel = pixels[index]
    x = float(pixel % view.width) + 0.5
    y = float(pixel // view.width) + 0.5
    direction = view.world_from_cam * ray_direction_cam(view, x, y)
    distance = wp.float32(0.0)
    start = wp.float32(0.0)
    if surface.see_through == 1:
        distance = trace(surface, view.center, direction, FAR, view.pixel_cone, ANY_SURFACE)
        start = wp.max(distance * (1.0 - SAME_POINT), 0.0)
    hit = wp.mesh_query_ray(surface.mesh, view.center + start * direction, direction, FAR)
    met = hit.result and distance >= 0.0
    distance = start + hit.t
    if not met:
        distance = surround_distance(view, view.center, direction)
    toward = view.center + distance * direction - right_center
    reach = wp.length(toward)
    toward = toward / reach
    reach *= 1.0 - SAME_POINT
    clear = wp.bool(True)
    if surface.see_through == 1:
        clear = trace(surface, right_center, toward, reach, view.pixel_cone, OPAQUE) < 0.0
    else:
        clear = not wp.mesh_query_ray_anyhit(surface.mesh, right_center, toward, reach)
    if met and clear:
        # The right eye may see the other side of a thin sheet.
        clear = wp.dot(hit.normal, direction) * wp.dot(hit.normal, toward) > 0.0
    visible[index] = wp.uint8(wp.where(clear, 1, 0))


@wp.kernel
def right_visibility_at_depth_kernel(
    first: int,
    view: View,
    surface: Surface,
    pixels: wp.array[int],
    right_center: wp.vec3,
    depth: wp.array[float],  # [height * width] planar z of what the left eye sees [m]
    solid: Surface,  # without what rays pass anyway
    # outputs
    visible: wp.array[wp.uint8],  # [pixels]
):
    """Look from the right eye at points of known depth: one ray each, two among see-through things."""
    index = first + wp.tid()
    pixel = pixels[index]
    x = float(pixel % view.width) + 0.5
    y = float(pixel // view.width) + 0.5
    direction_cam = ray_direction_cam(view, x, y)
    direction = view.world_from_cam * direction_cam
    distance = depth[pixel] / direction_cam[2]
    toward = view.center + distance * direction - right_center
    reach = wp.length(toward)
    toward = toward / reach
    near = reach * (1.0 - SAME_POINT)
    # Nothing lies behind the surround, and it has one side: any hit in between hides it.
    is_wall = distance > surround_distance(view, view.center, direction) * (1.0 - SAME_POINT)
    clear = wp.bool(True)
    if surface.see_through == 1:
        clear = trace(solid, right_center, toward, near, view.pixel_cone, OPAQUE) < 0.0
        if clear and not is_wall:
            origin = view.center + distance * (1.0 - SAME_POINT) * direction
            own = wp.mesh_query_ray(surface.mesh, origin, direction, FAR)
            if own.result:
                clear = wp.dot(own.normal, direction) * wp.dot(own.normal, toward) > 0.0
    elif is_wall:
        clear = not wp.mesh_query_ray_anyhit(surface.mesh, right_center, toward, near)
    else:
        hit = wp.mesh_query_ray(surface.mesh, right_center, toward, reach * (1.0 + SAME_POINT))
        if hit.result:
            clear = hit.t >= near
            # The right eye may see the other side of a thin sheet.
            clear = clear and wp.dot(hit.normal, direction) * wp.dot(hit.normal, toward) > 0.0
    visible[index] = wp.uint8(wp.where(clear, 1, 0))


@wp.kernel
def reflection_kernel(
    first: int,
    view: View,
    surface: Surface,
    pixels: wp.array[int],
    # outputs
    distances: wp.array[float],  # [pixels] [m]
):
    """Follow the reflected ray from the surface at a pixel center to the next opaque surface."""
    index = first + wp.tid()
    pixel = pixels[index]
    x = float(pixel % view.width) + 0.5
    y = float(pixel // view.width) + 0.5
    direction = view.world_from_cam * ray_direction_cam(view, x, y)
    distance = trace(surface, view.center, direction, FAR, view.pixel_cone, ANY_SURFACE)
    if distance < 0.0:
        distances[index] = 0.0
        return
    start = wp.max(distance * (1.0 - SAME_POINT), 0.0)
    hit = wp.mesh_query_ray(surface.mesh, view.center + start * direction, direction, FAR)
    if not hit.result:
        distances[index] = 0.0
        return
    normal = viewer_side_normal(surface, hit, direction)
    mirrored = wp.normalize(direction - 2.0 * wp.dot(direction, normal) * normal)
    outward = wp.where(wp.dot(hit.normal, direction) < 0.0, hit.normal, -hit.normal)
    origin = view.center + distance * direction + surface.lift * outward
    away = trace(surface, origin, mirrored, FAR, view.pixel_cone, OPAQUE)
    distances[index] = wp.where(away >= 0.0, away, surround_distance(view, origin, mirrored))


@wp.kernel
def depth_behind_kernel(
    first: int,
    view: View,
    solid: Surface,  # without what rays pass anyway
    pixels: wp.array[int],
    # outputs
    depth: wp.array[float],  # [pixels] planar z [m]
):
    """Look through all transparent surfaces at a pixel center."""
    index = first + wp.tid()
    pixel = pixels[index]
    x = float(pixel % view.width) + 0.5
    y = float(pixel // view.width) + 0.5
    direction_cam = ray_direction_cam(view, x, y)
    direction = view.world_from_cam * direction_cam
    distance = trace(solid, view.center, direction, FAR, view.pixel_cone, OPAQUE)
    if distance < 0.0:
        distance = surround_distance(view, view.center, direction)
    depth[index] = distance * direction_cam[2]


class SurfaceRays:
    """The rays of one frame, cast on request; those of whole frames are kept.

    Args:
        scene: on the device.
        camera: the left eye.
        baseline: distance of the right eye [m].
        surround: where the environment is.
        threads: 0: all cores.
    """

    def __init__(
        self,
        scene: DeviceScene,
        camera: Camera,
        baseline: float,
        surround: Surround,
        threads: int = 0,
    ) -> None:
        self._scene = scene
        self._camera = camera
        self._baseline = baseline
        self._view = make_view(camera, surround)
        self._threads = threads

    def right_visibility(
        self, where: np.ndarray | None = None, depth: np.ndarray | None = None
    ) -> np.ndarray:
        """Whether the right eye sees the point at each left pixel center, (height, width), bool.

        A point is seen if nothing opaque is in the way and both eyes see the same side of the surface.
        Points outside the right image count as seen. Rays are cast only at ``where``, (height, width),
        bool; None: everywhere, once. The other pixels count as seen. ``depth``: planar z of the points [m],
        (height, width), float32; it saves the rays that would find them.
        """
        return self._right_visibility if where is None else self._look_from_right(where, depth)

    def reflection_distance(self, where: np.ndarray | None = None) -> np.ndarray:
        """Distance from the surface to what it reflects [m], (height, width), float32.

        0 for the surround, which reflects nothing. NaN outside ``where``, (height, width), bool; None:
        everywhere, once.
        """
        return self._reflection_distance if where is None else self._look_along(where)

    def depth_behind(self, where: np.ndarray | None = None) -> np.ndarray:
        """Planar depth of the first opaque surface [m], (height, width), float32.

        The ray passes surfaces that hide less than half of the background, and goes straight on, also through
        bodies that bend light in the images. If nothing opaque follows, this is
        the depth of the surround. NaN outside ``where``, (height, width), bool;
        None: everywhere, once.
        """
        return self._depth_behind if where is None else self._look_behind(where)

    @cached_property
    def _right_visibility(self) -> np.ndarray:
        return self._look_from_right(self._everywhere)

    @cached_property
    def _reflection_distance(self) -> np.ndarray:
        return self._look_along(self._everywhere)

    @cached_property
    def _depth_behind(self) -> np.ndarray:
        return self._look_behind(self._everywhere)

    @property
    def _everywhere(self) -> np.ndarray:
        k = self._camera.intrinsics
        return np.ones((k.height, k.width), dtype=bool)

    def _look_from_right(self, where: np.ndarray, depth: np.ndarray | None = None) -> np.ndarray:
        right = wp.vec3(*self._camera.shifted_right(self._baseline).center_world)
        visible = np.ones(where.shape, dtype=bool)
        surface = self._scene.surface
        if depth is None:
            found = self._values(right_visibility_kernel, surface, where, wp.uint8, right)
        else:
            known = wp.array(depth.reshape(-1), dtype=float, device="cpu", copy=False)
            more = (right, known, self._scene.solid.surface)
            found = self._values(right_visibility_at_depth_kernel, surface, where, wp.uint8, *more)
        visible[where] = found != 0
        return visible

    def _look_along(self, where: np.ndarray) -> np.ndarray:
        return self._cast(reflection_kernel, where, self._scene.surface)

    def _look_behind(self, where: np.ndarray) -> np.ndarray:
        return self._cast(depth_behind_kernel, where, self._scene.solid.surface)

    def _cast(self, kernel: Any, where: np.ndarray, surface: Surface) -> np.ndarray:
        image = np.full(where.shape, np.nan, dtype=np.float32)
        image[where] = self._values(kernel, surface, where, float)
        return image

    def _values(
        self, kernel: Any, surface: Surface, where: np.ndarray, dtype: Any, *inputs: Any
    ) -> np.ndarray:
        """Return the values of a kernel at the pixels of ``where``, in reading order."""
        pixels = np.flatnonzero(where).astype(np.int32)
        values = wp.empty(len(pixels), dtype=dtype, device="cpu")
        numbers = wp.from_numpy(pixels, dtype=int, device="cpu")
        arguments = [self._view, surface, numbers, *inputs, values]
        launch_parallel(kernel, len(pixels), arguments, threads=self._threads)
        return values.numpy()
