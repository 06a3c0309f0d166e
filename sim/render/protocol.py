"""The interface of a renderer, which the ray caster and the OpenGL back end implement."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.sim.sensor.color.encoding import decode, encode
from digs_warp.sim.sensor.frame import FrameRays
from digs_warp.sim.sensor.highlights import Highlights


class Geometry(NamedTuple):
    """What lies at the pixel centers of one eye.

    Attributes:
        depth: planar z [m], shape (height, width), float32; the surround has that of its walls and floor.
        normals_world: unit normals toward the viewer, (height, width, 3), float32.
        material_ids: (height, width), int32; -1: the surround.
        object_ids: number of the object, (height, width), int32; 0: furniture or the surround.
    """

    depth: np.ndarray
    normals_world: np.ndarray
    material_ids: np.ndarray
    object_ids: np.ndarray


class Photograph(NamedTuple):
    """What a camera takes.

    Attributes:
        image: sRGB, shape (height, width, 3), uint8.
        mask: share of each pixel that objects cover, 0..255, shape (height, width), uint8.
        highlights: the light above white; None: unknown.
    """

    image: np.ndarray
    mask: np.ndarray
    highlights: Highlights | None


@dataclass(frozen=True, eq=False)
class RenderedView:
    """The view of one eye.

    Attributes:
        image: sRGB, shape (height, width, 3), uint8.
        mask: share of each pixel that objects cover, 0..255, shape (height, width), uint8.
        depth, normals_world, material_ids, object_ids: see `Geometry`.
    """

    image: np.ndarray
    mask: np.ndarray
    depth: np.ndarray
    normals_world: np.ndarray
    material_ids: np.ndarray
    object_ids: np.ndarray


@dataclass(frozen=True, eq=False)
class CameraTrack:
    """Poses of one eye during a frame.

    Attributes:
        intrinsics: of the whole image.
        world_from_cam: pose of each band of rows at each moment of its exposure, (bands, moments, 4, 4).
    """

    intrinsics: Intrinsics
    world_from_cam: np.ndarray

    def __post_init__(self) -> None:
        check_shape("world_from_cam", self.world_from_cam, (None, None, 4, 4))

    @staticmethod
    def still(camera: Camera) -> "CameraTrack":
        """Return the track of a camera that does not move."""
        return CameraTrack(camera.intrinsics, camera.world_from_cam[None, None])

    @property
    def edges(self) -> list[int]:
        """First row of each band, and the row after the last one."""
        bands = len(self.world_from_cam)
        return np.linspace(0, self.intrinsics.height, bands + 1).round().astype(int).tolist()

    def bands(self) -> Iterator[list[Camera]]:
        """Yield the cameras of each band's moments; a band is a separate camera with the same rays."""
        k = self.intrinsics
        for (top, bottom), poses in zip(pairwise(self.edges), self.world_from_cam, strict=True):
            rows = Intrinsics(k.width, bottom - top, k.fx, k.fy, k.cx, k.cy - top)
            yield [Camera(rows, pose) for pose in poses]


@dataclass(frozen=True, eq=False)
class Projected:
    """The light of a projector in one eye, linear; 1: a mean dot on a white wall that faces it at 1 m.

    Attributes:
        peak: of a mean dot, were its center here, (height, width), float32; 0 where no light arrives.
        light: of the pattern, (height, width), float32.
    """

    peak: np.ndarray
    light: np.ndarray


@dataclass(frozen=True, eq=False)
class Followed:
    """The points at the pixel centers of an image, as another eye sees them.

    Attributes:
        shift: how far to the right and down they appear there [px], (height, width, 2), float32; NaN where
            there is no point, or it is behind that eye.
        depth: planar z in that eye [m], (height, width), float32; NaN likewise.
        occlusion: `digs_warp.data.layers.Occlusion`, (height, width), uint8.
    """

    shift: np.ndarray
    depth: np.ndarray
    occlusion: np.ndarray


class Renderer(Protocol):
    """A scene in its surround, ready to be rendered for any camera inside."""

    @property
    def exposure(self) -> float:
        """The factor from radiance to pixel value, the same for every view."""
        ...

    def render(self, camera: Camera, samples_per_pixel: int = 4, seed: int = 0) -> RenderedView:
        """Return everything that one eye sees."""
        ...

    def render_image(
        self, camera: Camera, samples_per_pixel: int = 4, seed: int = 0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return only image and mask."""
        ...

    def photograph(self, track: CameraTrack, samples: int, seed: int = 0) -> Photograph:
        """Return what a moving camera takes.

        Args:
            track: its pose for each band of rows at each moment of the exposure.
            samples: per pixel and moment, >= 1.
            seed: of the sampling.
        """
        ...

    def render_geometry(self, camera: Camera) -> Geometry:
        """Return only what is at the pixel centers."""
        ...

    def project_dots(self, camera: Camera, world_from_projector: np.ndarray) -> Projected:
        """Return the light of a dot projector of that pose, (4, 4), in the camera."""
        ...

    def frame_rays(self, camera: Camera, baseline: float) -> FrameRays:
        """Return the rays for the sensor's effects; they are cast on request."""
        ...

    def follow(
        self, source: CameraTrack, depth: np.ndarray, material_ids: np.ndarray, target: CameraTrack
    ) -> Followed:
        """Return where another eye sees the points of an image, and whether it does.

        Args:
            source: the eye that sees them; one moment for each band of rows.
            depth: planar z at its pixel centers [m], (height, width), float32; NaN: nothing.
            material_ids: the same for materials, int32; -1: the surround.
            target: the other eye, likewise.
        """
        ...


def exposure_by_views(
    renderer: Renderer, track: CameraTrack, samples: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return image and mask of `Renderer.photograph` as the mean of many views, for any renderer."""
    seeds = np.random.SeedSequence(seed).generate_state(track.world_from_cam[..., 0, 0].size)
    numbers = iter(seeds.tolist())
    bands = [
        _mean([renderer.render_image(camera, samples, next(numbers)) for camera in cameras])
        for cameras in track.bands()
    ]
    images, masks = zip(*bands, strict=True)
    return np.concatenate(images), np.concatenate(masks)


def _mean(views: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean image (in linear light) and the mean mask of several views, uint8."""
    if len(views) == 1:
        return views[0]
    light = decode(views[0][0])
    cover = views[0][1].astype(np.float32)
    for image, mask in views[1:]:
        light += decode(image)
        cover += mask
    light /= len(views)
    return encode(light), (cover / len(views) + 0.5).astype(np.uint8)
