"""What the readers of other programs' folders return, and the base of those with numbered files."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.images import image_size
from digs_warp.data.point_cloud import PointCloud
from digs_warp.formats.captures.lens import PinholeView
from digs_warp.formats.captures.recorded_files import IMAGE_SUFFIXES, numbered_files
from digs_warp.geometry.camera import Intrinsics

MM_PER_METRE = 1000.0

# For formats without times: the cameras that write such folders take 30 frames per second.
FRAME_RATE = 30.0


@dataclass(frozen=True, eq=False)
class RecordedFrame:
    """One moment of a recording, in the files that another program wrote.

    Attributes:
        image: color image, any 8-bit format.
        intrinsics: camera of the capture's image, first pixel center at (0.5, 0.5).
        time: seconds.
        world_from_cam: pose, (4, 4), OpenCV axes, metres; None if unknown.
        depth: depth image, or None; floats are metres.
        depth_units_per_metre: the value of a pixel one metre away in a depth image of integers.
        depth_unknown: beside 0, the value of unknown pixels in a depth image of integers.
        mask: 8-bit mask, or None to use the alpha channel of the image, if it has one.
        right: image of the right eye, or None.
        view: how the image of that camera is made from the file; None: the file holds it.
        right_view: the same for the right eye.
    """

    image: Path
    intrinsics: Intrinsics
    time: float
    world_from_cam: np.ndarray | None = None
    depth: Path | None = None
    depth_units_per_metre: float = MM_PER_METRE
    depth_unknown: int = 0
    mask: Path | None = None
    right: Path | None = None
    view: PinholeView | None = None
    right_view: PinholeView | None = None

    @property
    def file_camera(self) -> Intrinsics:
        """The camera of the image file, without its lens."""
        return self.intrinsics if self.view is None else self.view.source

    def with_field_of_view(self, degrees: float) -> "RecordedFrame":
        """Return the frame with another field of view, if its image is made from that of a lens."""
        if self.view is None:
            return self
        view = self.view.with_field_of_view(degrees)
        right = self.right_view and self.right_view.with_field_of_view(degrees)
        return replace(self, intrinsics=view.target, view=view, right_view=right)


@dataclass(frozen=True, eq=False)
class DepthCamera:
    """The camera of depth images that are not registered to the color images.

    Attributes:
        intrinsics: first pixel center at (0.5, 0.5).
        color_from_depth: rigid motion [m], (4, 4); None: the two cameras are in the same place.
    """

    intrinsics: Intrinsics
    color_from_depth: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording in another program's folder; nothing has read its pixels yet.

    Attributes:
        folder: named in messages.
        frames: in order of time.
        depth_camera: of the depth images where it is not that of the color images.
        baseline: distance between the two eyes [m], or None.
        poses_in_metres: whether the unit of the poses is the metre; in some formats it is arbitrary.
        points: in the world of the poses, from which a reconstruction can start, or None.
    """

    folder: Path
    frames: tuple[RecordedFrame, ...]
    depth_camera: DepthCamera | None = None
    baseline: float | None = None
    points: PointCloud | None = None
    poses_in_metres: bool = True

    def thinned(self, count: int) -> "Recording":
        """Return the recording with at most ``count`` frames, evenly spread from the first to the last."""
        kept = np.unique(np.linspace(0, len(self.frames) - 1, count).round().astype(int))
        return replace(self, frames=tuple(self.frames[number] for number in kept))

    def with_field_of_view(self, degrees: float) -> "Recording":
        """Return the recording with another horizontal field of view of its undistorted images.

        Raises:
            CaptureError: no image is undistorted; the field of view of the others is as recorded.
        """
        if all(frame.view is None for frame in self.frames):
            raise CaptureError(
                f"recording '{self.folder}': its images have no lens distortion, so that --fov-deg has "
                "nothing to choose; leave it out"
            )
        frames = tuple(frame.with_field_of_view(degrees) for frame in self.frames)
        return replace(self, frames=frames)

    @property
    def knows_poses(self) -> bool:
        """Whether every frame has a pose."""
        return all(frame.world_from_cam is not None for frame in self.frames)


@dataclass(frozen=True, eq=False)
class NumberedFiles:
    """A recording whose images and depth maps have their number in their name, as in most formats.

    Attributes:
        folder: the recording, named in messages.
        images: color images by number, ascending; at least one.
        depths: depth images by number; some may be missing.
    """

    folder: Path
    images: dict[int, Path]
    depths: dict[int, Path]

    @staticmethod
    def find(
        folder: Path, images: str, depths: str, depth_suffixes: tuple[str, ...] = (".png",)
    ) -> "NumberedFiles":
        """Find the files; ``images`` and ``depths`` are what precedes the number, such as "rgb/" or "left".

        Raises:
            CaptureError: no images.
        """
        found = numbered_files(folder, images, IMAGE_SUFFIXES)
        if not found:
            raise CaptureError(
                f"recording '{folder}': no images {images}NUMBER.png or .jpg; is this the right --from?"
            )
        return NumberedFiles(folder, found, numbered_files(folder, depths, depth_suffixes))

    @property
    def image_size(self) -> tuple[int, int]:
        """(width, height) of the first image."""
        return image_size(next(iter(self.images.values())))

    def recording(
        self,
        cameras: Intrinsics | Mapping[int, Intrinsics],
        poses: Mapping[int, np.ndarray | None],
        *,
        frame_rate: float = FRAME_RATE,
        depth_camera: DepthCamera | None = None,
        baseline: float | None = None,
        **layers: Mapping[int, Any],
    ) -> Recording:
        """Return a frame per image; its number gives its time.

        Args:
            cameras: the camera of all images, or one for each number.
            poses: world_from_cam by number; a missing pose is unknown.
            frame_rate: numbers per second.
            depth_camera: see `Recording`.
            baseline: see `Recording`.
            **layers: other fields of `RecordedFrame` by number; some may be missing.
        """
        frames = tuple(
            RecordedFrame(
                image=image,
                intrinsics=cameras if isinstance(cameras, Intrinsics) else cameras[number],
                time=number / frame_rate,
                world_from_cam=poses.get(number),
                depth=self.depths.get(number),
                **{name: layer[number] for name, layer in layers.items() if number in layer},
            )
            for number, image in self.images.items()
        )
        return Recording(self.folder, frames, depth_camera=depth_camera, baseline=baseline)
