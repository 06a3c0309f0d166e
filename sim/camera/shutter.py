"""What a shutter does to a moving camera's image: rows are read one after another, each after an exposure.

Every band of rows is rendered from the camera's pose at its time, and every exposure is the mean of several
moments along the path: occlusion, highlights, mask and depth are correct, because nothing is warped.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.sim.render.views import CameraTrack, Geometry, Photograph, Projected
from digs_warp.sim.sensor.frame import FrameRays

if TYPE_CHECKING:
    from digs_warp.sim.render.raycast import RaycastRenderer

# Camera pose, ``world_from_cam``, a time [s] after the middle of the frame.
PoseAt = Callable[[float], np.ndarray]


@dataclass(frozen=True)
class Shutter:
    """A shutter; the default is ideal: open for an instant, all rows at once.

    Attributes:
        bands: of rows that share a time, >= 1.
        views: that are averaged per exposure, >= 1.
        readout_time: from the first to the last row [s].
        exposure_time: [s].
    """

    bands: int = 1
    views: int = 1
    readout_time: float = 0.0
    exposure_time: float = 0.0

    def moments(self, band: int) -> np.ndarray:
        """Return the times [s] of a band's views, shape (views,), 0 in the middle of the frame."""
        middle = ((band + 0.5) / self.bands - 0.5) * self.readout_time
        return middle + ((np.arange(self.views) + 0.5) / self.views - 0.5) * self.exposure_time


@dataclass(frozen=True, eq=False)
class ShutteredEye:
    """One eye of a moving camera, seen through a shutter.

    Attributes:
        renderer: of the scene.
        shutter: of the camera.
        intrinsics: of the whole image.
        pose_at: of this eye.
    """

    renderer: "RaycastRenderer"
    shutter: Shutter
    intrinsics: Intrinsics
    pose_at: PoseAt

    def photograph(self, samples_per_pixel: int, seed: np.random.SeedSequence) -> Photograph:
        """Return what the eye takes.

        The samples of a pixel are divided among the views, at least one for each.
        """
        samples = max(1, samples_per_pixel // self.shutter.views)
        return self.renderer.photograph(self.track, samples, int(seed.generate_state(1)[0]))

    @property
    def track(self) -> CameraTrack:
        """The poses for each band at each moment of its exposure."""
        poses = [
            [self.pose_at(float(moment)) for moment in self.shutter.moments(band)]
            for band in range(self.shutter.bands)
        ]
        return CameraTrack(self.intrinsics, np.array(poses))

    @property
    def middle_track(self) -> CameraTrack:
        """The pose for each band in the middle of its exposure."""
        return CameraTrack(
            self.intrinsics, np.array([[self.pose_at(middle)] for middle in self._middles])
        )

    def geometry(self) -> Geometry:
        """Return what is at the pixel centers at the middle of each row's exposure."""
        layers = [self.renderer.render_geometry(camera) for camera in self.cameras()]
        return Geometry(*(np.concatenate(bands) for bands in zip(*layers, strict=True)))

    def project_dots(self, projector_at: PoseAt) -> Projected:
        """Return the light of a projector at the middle of each row's exposure.

        The dots move with the camera, so that its motion hardly blurs them.
        """
        parts = [
            self.renderer.project_dots(camera, projector_at(middle))
            for camera, middle in zip(self.cameras(), self._middles, strict=True)
        ]
        peaks, lights = ([part.peak for part in parts], [part.light for part in parts])
        return Projected(np.concatenate(peaks), np.concatenate(lights))

    def rays(self, baseline: float) -> FrameRays:
        """Return the rays for the sensor's effects; they are cast on request."""
        cameras = list(self.cameras())
        rays = [self.renderer.frame_rays(camera, baseline) for camera in cameras]
        heights = tuple(camera.intrinsics.height for camera in cameras)
        return rays[0] if len(rays) == 1 else BandedRays(tuple(rays), heights)

    @property
    def _middles(self) -> list[float]:
        """The middle of each band's exposure [s]."""
        return [float(self.shutter.moments(band).mean()) for band in range(self.shutter.bands)]

    def cameras(self) -> Iterator[Camera]:
        """Yield the camera of each band in the middle of its exposure."""
        for (camera,) in self.middle_track.bands():
            yield camera


@dataclass(frozen=True, eq=False)
class BandedRays:
    """The rays of an image whose rows were seen from different places."""

    bands: tuple[FrameRays, ...]
    heights: tuple[int, ...]

    def right_visibility(self, where: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """See `FrameRays`."""
        return self._joined("right_visibility", where, depth)

    def reflection_distance(self, where: np.ndarray) -> np.ndarray:
        """See `FrameRays`."""
        return self._joined("reflection_distance", where)

    def depth_behind(self, where: np.ndarray) -> np.ndarray:
        """See `FrameRays`."""
        return self._joined("depth_behind", where)

    def _joined(self, kind: str, *images: np.ndarray) -> np.ndarray:
        """Ask every band about its rows of the images."""
        parts = [np.split(image, np.cumsum(self.heights)[:-1]) for image in images]
        asked = zip(self.bands, *parts, strict=True)
        return np.concatenate([getattr(band, kind)(*part) for band, *part in asked])
