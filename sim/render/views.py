"""What a renderer takes and returns: cameras that move, photographs, and what lies at pixel centers."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from digs_warp.geometry.camera import Camera, Intrinsics
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
class CameraTrack:
    """Poses of one eye during a frame.

    Attributes:
        intrinsics: of the whole image.
        world_from_cam: pose of each band of rows at each moment of its exposure, (bands, moments, 4, 4).
    """

    intrinsics: Intrinsics
    world_from_cam: np.ndarray

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
