"""The default renderer: rays through a Warp BVH on all cores, without a graphics driver."""

# Warp's type hints take the dtype of an array for a value, and structs for functions.
# pyright: reportArgumentType=false, reportGeneralTypeIssues=false

from typing import Any

import numpy as np
import warp as wp

from digs_warp.camera import Camera
from digs_warp.checks import DigsError
from digs_warp.device.parallel import launch_parallel
from digs_warp.sim.environment import Environment
from digs_warp.sim.render.kernels import color_kernel, geometry_kernel
from digs_warp.sim.render.lighting import prepare_light
from digs_warp.sim.render.openness import measure_openness
from digs_warp.sim.render.projector import project_dots
from digs_warp.sim.render.protocol import CameraTrack, Projected, RenderedView
from digs_warp.sim.render.rays import SurfaceRays
from digs_warp.sim.render.upload import upload_scene
from digs_warp.sim.render.view import make_track, make_view
from digs_warp.sim.scene import Scene


class RaycastRenderer:
    """A scene and its environment, ready to be rendered for any camera inside the surround."""

    def __init__(self, scene: Scene, environment: Environment, threads: int = 0) -> None:
        self.threads = threads
        self.surround_radius = environment.radius
        self._source = scene
        self._panorama_height = environment.radiance.shape[0]
        self._light = prepare_light(environment, threads)
        self._scene = upload_scene(scene)
        self._surface = self._scene.surface
        self._has_openness = False  # measured for the first image

    @property
    def exposure(self) -> float:
        """The factor from radiance to pixel value, the same for every view."""
        return self._light.exposure

    def render(self, camera: Camera, samples_per_pixel: int = 4, seed: int = 0) -> RenderedView:
        """Return image, mask, depth, normals and material ids of a view."""
        image, mask = self.render_image(camera, samples_per_pixel, seed)
        depth, normals, materials = self.render_geometry(camera)
        return RenderedView(image, mask, depth, normals, materials)

    def render_image(
        self, camera: Camera, samples_per_pixel: int = 4, seed: int = 0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the image, (height, width, 3), and the mask, (height, width), both uint8.

        The same (camera, samples_per_pixel, seed) gives the same bytes, whatever was rendered before.
        """
        if samples_per_pixel < 1:
            raise DigsError(f"samples_per_pixel: {samples_per_pixel}, expected at least 1")
        return self.render_exposure(CameraTrack.still(camera), samples_per_pixel, seed)

    def render_exposure(
        self, track: CameraTrack, samples: int, seed: int = 0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return image and mask of a moving camera; every ray starts from the camera's pose at its moment."""
        k = track.intrinsics
        first = Camera(k, track.world_from_cam[0, 0])
        view = make_view(first, self.surround_radius, samples)
        way = make_track(track, self.surround_radius)
        pixel_angle = 1.0 / min(k.fx, k.fy)
        texel_angle = np.pi / self._panorama_height
        surround_level = float(max(0.0, np.log2(pixel_angle / texel_angle)))
        surround_step = float(max(pixel_angle, texel_angle))
        if not self._has_openness:
            measure_openness(self._source, self._surface, self.threads)
            self._has_openness = True
        image = wp.empty((k.height * k.width, 3), dtype=wp.uint8, device="cpu")
        mask = wp.empty(k.height * k.width, dtype=wp.uint8, device="cpu")
        scalars = [surround_level, surround_step, samples, _int32(seed)]
        inputs = [view, way, self._surface, self._light.struct, *scalars, image, mask]
        self._launch(color_kernel, k.height * k.width, inputs)
        return image.numpy().reshape(k.height, k.width, 3), mask.numpy().reshape(k.height, k.width)

    def render_geometry(self, camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return depth, world normals and material ids at the pixel centers; see `RenderedView`."""
        view = make_view(camera, self.surround_radius)
        height, width = camera.intrinsics.height, camera.intrinsics.width
        depth = wp.empty(height * width, dtype=float, device="cpu")
        normals = wp.empty(height * width, dtype=wp.vec3, device="cpu")
        materials = wp.empty(height * width, dtype=int, device="cpu")
        inputs = [view, self._surface, depth, normals, materials]
        self._launch(geometry_kernel, height * width, inputs)
        return (
            depth.numpy().reshape(height, width),
            normals.numpy().reshape(height, width, 3),
            materials.numpy().reshape(height, width),
        )

    def project_dots(self, camera: Camera, world_from_projector: np.ndarray) -> Projected:
        """Return the light of a dot projector of that pose, (4, 4), in the camera."""
        surface, radius = self._surface, self.surround_radius
        return project_dots(surface, camera, radius, world_from_projector, self.threads)

    def frame_rays(self, camera: Camera, baseline: float) -> SurfaceRays:
        """Return the rays for the sensor's effects; they are cast on request."""
        return SurfaceRays(self._scene, camera, baseline, self.surround_radius, self.threads)

    def _launch(self, kernel: Any, dim: int, inputs: list[Any]) -> None:
        launch_parallel(kernel, dim, inputs, threads=self.threads)


def _int32(seed: int) -> int:
    """Fold any non-negative seed into the range of a kernel's int."""
    return int(np.uint32(seed % 2**32).astype(np.int32))
