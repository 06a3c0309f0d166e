"""The default renderer: rays through a Warp BVH on all cores."""

import math
from threading import Lock

import numpy as np
import warp as wp

from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.camera import Camera
from digs_warp.sim.render.ambient_occlusion import measure_openness
from digs_warp.sim.render.environment_light import prepare_light
from digs_warp.sim.render.ground_light import measure_plane, planes_of
from digs_warp.sim.render.kernels import color_kernel, roughness_kernel
from digs_warp.sim.render.pixel_centers import geometry_at_pixel_centers
from digs_warp.sim.render.projector import project_dots
from digs_warp.sim.render.rays import SurfaceRays
from digs_warp.sim.render.reprojection import follow
from digs_warp.sim.render.shadows import prepare_shadows
from digs_warp.sim.render.surround_pixels import PIECE, Image, surround_kernel
from digs_warp.sim.render.upload import upload_scene
from digs_warp.sim.render.view import make_track, make_view, srgb_encoding
from digs_warp.sim.render.views import CameraTrack, Followed, Geometry, Photograph, Projected
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import Scene
from digs_warp.sim.sensor.highlights import Highlights

# A single sample looks up textures as if it were one of two in its pixel: their filter is wider than a pixel.
SMOOTH = 2.0

# Where the objects move farther to either side during the exposure [px], one sample tells too little.
LONGEST_WAY = 3.0

# Pixels of an image that one thread renders before others have started: those by which a camera meters light.
# To look for smooth ones among them takes longer than all their samples.
TINY = 1024


class RaycastRenderer:
    """A scene and its environment, ready to be rendered for any camera inside the surround."""

    def __init__(self, scene: Scene, environment: Environment, threads: int = 0) -> None:
        self.threads = threads
        self.surround = environment.surround
        self._source = scene
        self._panorama_height = environment.radiance.shape[0]
        self._table, self._floor = planes_of(scene, environment)
        below = None if self._table is None else self._table.albedo
        # From radiance to pixel value, the same for every view.
        self.exposure, self._light = prepare_light(environment, threads, below)
        self._scene = upload_scene(scene)
        self._surface = self._scene.surface
        self._measuring = Lock()
        self._has_openness = False  # measured for the first image

    def render_image(
        self, camera: Camera, samples_per_pixel: int = 4, seed: int = 0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the image, (height, width, 3), and the mask, (height, width), both uint8.

        The same (camera, samples_per_pixel, seed) gives the same bytes, whatever was rendered before.
        """
        return self.photograph(CameraTrack.still(camera), samples_per_pixel, seed)[:2]

    def photograph(self, track: CameraTrack, samples: int, seed: int = 0) -> Photograph:
        """Return what a moving camera takes.

        Args:
            track: its pose for each band of rows at each moment of the exposure; rays start from there.
            samples: per pixel and moment, >= 1.
            seed: of the sampling.
        """
        k = track.intrinsics
        first = Camera(k, track.world_from_cam[0, 0])
        count, threads = k.height * k.width, self._threads(k.height * k.width)
        pixel_angle = 1.0 / min(k.fx, k.fy)
        texel_angle = np.pi / self._panorama_height
        way = make_track(track, self.surround)
        way.texels = float(pixel_angle / texel_angle)
        with self._measuring:  # recordings of several threads may share a renderer
            if not self._has_openness:
                self._measure_openness()
        image = _empty_image(count)
        folded = int(np.uint32(seed % 2**32).astype(np.int32))  # a kernel's int
        scene = [way, self._surface, self._light, srgb_encoding()]

        def render(numbers: np.ndarray, samples: int, sharing: float) -> None:
            """Render some pixels; each sample stands for its share of a pixel, one of ``sharing``."""
            image.numbers = wp.array(numbers.astype(np.int32), dtype=int, device="cpu", copy=False)
            view = make_view(first, self.surround, sharing)
            inputs = [view, *scene, samples, folded, image]
            launch_parallel(color_kernel, len(numbers), inputs, threads=threads)

        alone = [make_view(first, self.surround), *scene, image]
        pieces = k.height * -(-k.width // int(PIECE))
        launch_parallel(surround_kernel, pieces, alone, threads=threads)
        numbers = np.flatnonzero(image.kinds.numpy())
        together = samples * track.world_from_cam.shape[1]
        distance = np.linalg.norm(track.world_from_cam[..., :3, 3], axis=-1).min()
        nearness = 1.0 / max(distance, 1e-6)
        moved = (way.swings.numpy() + nearness * way.shifts.numpy()).max() / pixel_angle
        if together > 1 and count > TINY and moved <= LONGEST_WAY:
            render(numbers, 0, SMOOTH)
            image.rough = wp.empty(len(numbers), dtype=wp.uint8, device="cpu")
            where = [k.width, k.height, max(1, math.ceil(moved)), image]
            launch_parallel(roughness_kernel, len(numbers), where, threads=threads)
            numbers = numbers[image.rough.numpy() > 0]
        render(numbers, samples, together)
        seen = image.bytes.numpy().reshape(k.height, k.width, 3)
        highlights = Highlights.of(seen, image.light.numpy())
        return Photograph(seen, image.mask.numpy().reshape(k.height, k.width), highlights)

    def render_geometry(self, camera: Camera) -> Geometry:
        """Return what is at the pixel centers."""
        threads = self._threads(camera.intrinsics.height * camera.intrinsics.width)
        return geometry_at_pixel_centers(self._surface, camera, self.surround, threads)

    def project_dots(self, camera: Camera, world_from_projector: np.ndarray) -> Projected:
        """Return the light of a dot projector of that pose, (4, 4), in the camera."""
        return project_dots(
            self._surface, camera, self.surround, world_from_projector, self.threads
        )

    def frame_rays(self, camera: Camera, baseline: float) -> SurfaceRays:
        """Return the rays for the sensor's effects; they are cast on request."""
        return SurfaceRays(self._scene, camera, baseline, self.surround, self.threads)

    def follow(self, source: CameraTrack, depth: np.ndarray, target: CameraTrack) -> Followed:
        """Return where another eye sees the points of an image, and whether it does.

        Args:
            source: the eye that sees them; one moment for each band of rows.
            depth: planar z at its pixel centers [m], (height, width), float32; NaN: nothing.
            target: the other eye, likewise.
        """
        return follow(self._scene, source, depth, target, self.threads)

    def _measure_openness(self) -> None:
        """Measure the light on the ground, which lights the objects from below, and then on them."""
        surface, light = self._surface, self._light
        if self._table is not None:
            surface.table = measure_plane(surface, light, self._table, self.threads)
        if self._floor is not None:
            surface.floor = measure_plane(surface, light, self._floor, self.threads)
        measure_openness(self._source, surface, self.threads)
        prepare_shadows(self._source, surface, light.keys.count)
        self._has_openness = True

    def _threads(self, pixels: int) -> int:
        return 1 if pixels <= TINY else self.threads


def _empty_image(count: int) -> Image:
    """Return memory for an image of so many pixels."""
    image = Image()
    image.bytes = wp.empty((count, 3), dtype=wp.uint8, device="cpu")
    image.light = wp.empty((count, 3), dtype=float, device="cpu")
    image.mask = wp.empty(count, dtype=wp.uint8, device="cpu")
    image.kinds = wp.empty(count, dtype=wp.uint8, device="cpu")
    image.around = wp.empty(count, dtype=wp.vec3, device="cpu")
    return image
