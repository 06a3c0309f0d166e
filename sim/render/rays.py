"""Rays that only some effects of the sensor need; see `digs_warp.sim.sensor.frame.FrameRays`."""

from typing import Any

import numpy as np
import warp as wp

from digs_warp.data.layers import Occlusion
from digs_warp.device.kernel_options import exact_vector_module_options
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.camera import Camera
from digs_warp.sim.render.reprojection import follow_some
from digs_warp.sim.render.surface import ANY_SURFACE, OPAQUE, Surface, trace, viewer_side_normal
from digs_warp.sim.render.surround import boundary_distance
from digs_warp.sim.render.upload import DeviceScene
from digs_warp.sim.render.view import FAR, View, center_ray, make_view
from digs_warp.sim.render.views import CameraTrack
from digs_warp.sim.scene.environment import Surround

# Without Warp's flags, which would inline the traversal wherever a ray is cast: 3 s to compile.
wp.set_module_options(exact_vector_module_options())

# Points along a ray that differ by less than this share of their distance are the same point: float32 hits
# from two eyes differ by a tenth of that.
SAME_POINT = wp.constant(1.0e-4)


@wp.kernel
def reflection_kernel(
    first: int,
    view: View,
    pixels: wp.array[int],
    surface: Surface,
    # outputs
    distances: wp.array[float],  # [pixels] [m]
):
    """Follow the reflected ray from the surface at a pixel center to the next opaque surface."""
    index = first + wp.tid()
    pixel = pixels[index]
    direction = view.world_from_cam * center_ray(view, pixel)
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
    distances[index] = wp.where(
        away >= 0.0, away, boundary_distance(view.boundary, origin, mirrored)
    )


@wp.kernel
def depth_behind_kernel(
    first: int,
    view: View,
    pixels: wp.array[int],
    surface: Surface,
    # outputs
    depth: wp.array[float],  # [pixels] planar z [m]
):
    """Look through all transparent surfaces at a pixel center."""
    index = first + wp.tid()
    pixel = pixels[index]
    direction_cam = center_ray(view, pixel)
    direction = view.world_from_cam * direction_cam
    distance = trace(surface, view.center, direction, FAR, view.pixel_cone, OPAQUE)
    if distance < 0.0:
        distance = boundary_distance(view.boundary, view.center, direction)
    depth[index] = distance * direction_cam[2]


class SurfaceRays:
    """The rays of one frame, cast on request.

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
        self._camera, self._baseline = camera, baseline
        self._view = make_view(camera, surround)
        self._threads = threads

    def right_visibility(self, where: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Whether the right eye sees the point at each left pixel center, (height, width), bool.

        A point is seen if nothing opaque is in the way and both eyes see the same side of the surface.
        Points outside the right image count as seen, and so do those outside ``where``, (height, width),
        bool. ``depth``: planar z of the points [m], (height, width), float32.
        """
        eyes = (self._camera, self._camera.shifted_right(self._baseline))
        source, target = map(CameraTrack.still, eyes)
        asked = where & (depth > 0)  # NaN is not
        states = follow_some(self._scene, source, depth, asked, target, self._threads)[2]
        visible = np.ones(where.shape, bool)
        visible[asked] = states != Occlusion.HIDDEN
        return visible

    def reflection_distance(self, where: np.ndarray) -> np.ndarray:
        """Distance from the surface to what it reflects [m], (height, width), float32.

        0 for the surround, which reflects nothing. NaN outside ``where``, (height, width), bool.
        """
        unknown = np.full(where.shape, np.nan, np.float32)
        return self._cast(reflection_kernel, where, [self._scene.surface], unknown)

    def depth_behind(self, where: np.ndarray) -> np.ndarray:
        """Planar depth of the first opaque surface [m], (height, width), float32.

        The ray passes surfaces that hide less than half of the background, and goes straight on, also through
        bodies that bend light in the images. If nothing opaque follows, this is the depth of the surround.
        NaN outside ``where``, (height, width), bool.
        """
        unknown = np.full(where.shape, np.nan, np.float32)
        return self._cast(depth_behind_kernel, where, [self._scene.surface], unknown)

    def _cast(
        self, kernel: Any, where: np.ndarray, inputs: list[Any], image: np.ndarray
    ) -> np.ndarray:
        """Return an image with the values of a kernel at the pixels of ``where``."""
        pixels = np.flatnonzero(where).astype(np.int32)
        values = wp.empty(len(pixels), dtype=wp.dtype_from_numpy(image.dtype), device="cpu")
        numbers = wp.from_numpy(pixels, dtype=int, device="cpu")
        arguments = [self._view, numbers, *inputs, values]
        launch_parallel(kernel, len(pixels), arguments, threads=self._threads)
        image[where] = values.numpy()
        return image
