"""What a renderer is: the ray caster and the OpenGL back end give the same things."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from digs_warp.camera import Camera
from digs_warp.sim.render.track import CameraTrack
from digs_warp.sim.sensor.frame import FrameRays


@dataclass(frozen=True, eq=False)
class RenderedView:
    """What one eye sees.

    Attributes:
        image: sRGB, shape (height, width, 3), uint8.
        mask: share of each pixel that the object covers, 0..255, shape (height, width), uint8.
        depth: planar z at the pixel centres [m], shape (height, width), float32; the surround has the
            depth of its sphere.
        normals_world: unit normals toward the viewer at the pixel centres, (height, width, 3), float32.
        material_ids: material at the pixel centres, (height, width), int32; -1: the surround.
    """

    image: np.ndarray
    mask: np.ndarray
    depth: np.ndarray
    normals_world: np.ndarray
    material_ids: np.ndarray


class Renderer(Protocol):
    """A scene in its surround, ready to be seen from any camera inside."""

    @property
    def exposure(self) -> float:
        """The factor from radiance to pixel value, the same for every view."""
        ...

    def render(self, camera: Camera, samples_per_pixel: int = 4, seed: int = 0) -> RenderedView:
        """Return all that one eye sees."""
        ...

    def render_image(
        self, camera: Camera, samples_per_pixel: int = 4, seed: int = 0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return image and mask alone."""
        ...

    def render_exposure(
        self, track: CameraTrack, samples: int, seed: int = 0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return image and mask of a moving camera.

        Args:
            track: where it is in each band of rows at each moment of its exposure.
            samples: per pixel and moment, >= 1.
            seed: of the sampling.
        """
        ...

    def render_geometry(self, camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return depth, world normals and material ids alone."""
        ...

    def frame_rays(self, camera: Camera, baseline: float) -> FrameRays:
        """Return the rays that the sensor's effects may ask for; none is cast before that."""
        ...
