"""A camera that moves while its rows are read and exposed: which way it stood when, for every renderer."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from digs_warp.camera import Camera, Intrinsics
from digs_warp.checks import check_shape
from digs_warp.sim.sensor.color.encoding import decode, encode


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
        """Yield the cameras of each band's moments; a band is a camera of its own with the same rays."""
        k = self.intrinsics
        for (top, bottom), poses in zip(pairwise(self.edges), self.world_from_cam, strict=True):
            rows = Intrinsics(k.width, bottom - top, k.fx, k.fy, k.cx, k.cy - top)
            yield [Camera(rows, pose) for pose in poses]


class ImageRenderer(Protocol):
    """Renders images of cameras at rest."""

    def render_image(
        self, camera: Camera, samples_per_pixel: int = 4, seed: int = 0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return image and mask."""
        ...


def exposure_by_views(
    renderer: ImageRenderer, track: CameraTrack, samples: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return image, (height, width, 3), and mask, (height, width), both uint8: the mean of many views.

    Works with any renderer; see `digs_warp.sim.render.protocol.Renderer.render_exposure` for the arguments.
    """
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
