"""Writes a capture frame by frame, to a folder that `digs_warp.data.capture` reads or to memory."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import CaptureError, DigsError, check_finite
from digs_warp.data.about import About
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.frame import Frame, PixelSource
from digs_warp.data.images import write_image
from digs_warp.data.index_rules import DEPTH_UNIT, FORMAT_VERSION, INDEX_NAME, POINTS_KEY
from digs_warp.data.layers import BASIC_LAYERS, Layer
from digs_warp.data.objects import ObjectView
from digs_warp.data.point_cloud import PointCloud, write_points
from digs_warp.data.rig import UNKNOWN_EXPOSURE, Exposure, Rig
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.record import typed
from digs_warp.record.files import to_json, write_atomically
from digs_warp.record.manifest import is_kept

POINTS = "sparse_pc.ply"  # the name that nerfstudio's own programs give it


@dataclass(frozen=True, eq=False)
class FrameImages:
    """The pixels of one frame as `CaptureWriter` expects them; see `Frame` for their meaning.

    ``depth`` also says why a value is missing: -inf is too near, +inf too far, NaN any other reason.
    ``confidence`` is 0 to 255 here, as in the file.
    """

    image: np.ndarray
    depth: np.ndarray | None = None
    mask: np.ndarray | None = None
    unknown: np.ndarray | None = None
    right: np.ndarray | None = None
    depth_true: np.ndarray | None = None
    cause: np.ndarray | None = None
    confidence: np.ndarray | None = None
    normals: np.ndarray | None = None
    infrared_left: np.ndarray | None = None
    infrared_right: np.ndarray | None = None
    instances: np.ndarray | None = None
    depth_right: np.ndarray | None = None
    mask_right: np.ndarray | None = None
    disparity: np.ndarray | None = None
    disparity_right: np.ndarray | None = None
    occlusion: np.ndarray | None = None
    occlusion_right: np.ndarray | None = None
    flow: np.ndarray | None = None
    flow_occlusion: np.ndarray | None = None

    def by_layer(self) -> dict[Layer, np.ndarray]:
        """Return the images that are present."""
        images = {layer: getattr(self, layer.name.lower()) for layer in Layer}
        return {layer: pixels for layer, pixels in images.items() if pixels is not None}

    def with_layers(self, images: Mapping[Layer, np.ndarray]) -> "FrameImages":
        """Return the frame with more images."""
        return replace(self, **{layer.name.lower(): pixels for layer, pixels in images.items()})


@dataclass
class CaptureWriter:
    """Writes a capture folder frame by frame; the index is written last, so it never names a missing file.

    Frames may be written in any order. `has_frame` says which are complete, so an interrupted run can
    continue where it stopped. Without a folder, the capture is collected in memory.
    """

    folder: Path | None
    intrinsics: Intrinsics
    rig: Rig | None = None
    _layers: dict[int, Mapping[Layer, np.ndarray]] = field(default_factory=dict)
    _frames: dict[int, Frame] = field(default_factory=dict)

    def has_frame(self, number: int, layers: Sequence[Layer] = BASIC_LAYERS) -> bool:
        """Whether the files of these layers of frame ``number`` are there, written by a run of ours."""
        if self.folder is None:
            return set(layers) <= self._layers.get(number, {}).keys()
        return all(is_kept(self.folder / layer.pattern.format(number)) for layer in layers)

    def write_frame(
        self, number: int, images: FrameImages, intrinsics: Intrinsics | None = None
    ) -> None:
        """Write the files of frame ``number``; ``intrinsics`` is its camera if not that of the others."""
        k = intrinsics or self.intrinsics
        shape = (k.height, k.width)
        for layer, pixels in images.by_layer().items():
            if pixels.shape[:2] != shape:
                raise CaptureError(
                    f"frame {number}, {layer.value}: shape {pixels.shape}, expected {shape}"
                )
            if self.folder is not None:
                write_image(self.folder / layer.pattern.format(number), pixels)
        if self.folder is None:
            self._layers[number] = images.by_layer()

    def add_pose(
        self,
        number: int,
        world_from_cam: np.ndarray,
        time: float,
        intrinsics: Intrinsics | None = None,
        color_gain: tuple[float, float, float] | None = None,
        objects: Sequence[ObjectView] = (),
        exposure: Exposure = UNKNOWN_EXPOSURE,
    ) -> None:
        """Record the pose and time [s] of frame ``number``, whose images have been written.

        ``intrinsics`` is the frame's camera if it differs from the others'; ``color_gain``, ``objects`` and
        ``exposure`` see `Frame`.
        """
        check_finite(f"frame {number}: world_from_cam", world_from_cam)
        camera = Camera(intrinsics or self.intrinsics, world_from_cam)
        layers: Mapping[Layer, PixelSource] = self._layers.get(number, {})
        if self.folder is not None:
            paths = {layer: self.folder / layer.pattern.format(number) for layer in Layer}
            layers = {layer: path for layer, path in paths.items() if path.is_file()}
        self._frames[number] = Frame(
            f"{number:04d}", camera, time, layers, color_gain, tuple(objects), exposure=exposure
        )

    def _entry(self, frame: Frame, folder: Path) -> dict[str, Any]:
        """Return a frame's part of transforms.json; of the camera, what differs from that of the others."""
        k, gain = frame.camera.intrinsics, frame.color_gain
        files = {layer.value: frame.path(layer) for layer in frame.layers}
        size = size_keys(k) if size_keys(k) != size_keys(self.intrinsics) else {}
        return {
            **{key: path.relative_to(folder).as_posix() for key, path in files.items()},
            "transform_matrix": (frame.camera.world_from_cam @ OPENCV_FROM_OPENGL).tolist(),
            "time": frame.time,
            **(size | camera_keys(k) if k != self.intrinsics else {}),
            **({} if gain is None else {"color_gain": list(gain)}),
            **({"objects": [*map(typed.to_json, frame.objects)]} if frame.objects else {}),
            **typed.to_json(frame.exposure),
        }

    def finish(self, about: About | None = None, points: PointCloud | None = None) -> Capture:
        """Write transforms.json, and the sparse points if there are any, and return the capture."""
        frames = tuple(self._frames[number] for number in sorted(self._frames))
        if self.folder is None:
            return Capture(None, frames, self.rig, about or About(), points)
        if not frames:
            raise DigsError(f"capture '{self.folder}': no frame was added")
        if points is not None:
            write_points(self.folder / POINTS, points)
        ours: dict[str, Any] = {"format_version": FORMAT_VERSION, "depth_unit": DEPTH_UNIT}
        if self.rig is not None:
            ours["rig"] = typed.to_json(self.rig)
        index = {
            "camera_model": "PINHOLE",
            **size_keys(self.intrinsics),
            **camera_keys(self.intrinsics),
            **({} if points is None else {POINTS_KEY: POINTS}),
            "digs_warp": ours | typed.to_json(about or About()),
            "frames": [self._entry(frame, self.folder) for frame in frames],
        }
        write_atomically(self.folder / INDEX_NAME, to_json(index).encode())
        return read_capture(self.folder)


def size_keys(k: Intrinsics) -> dict[str, int]:
    """Return the keys of transforms.json that give the image size [px]."""
    return {"w": k.width, "h": k.height}


def camera_keys(k: Intrinsics) -> dict[str, float]:
    """Return the keys of transforms.json that give focal lengths and principal point [px]."""
    return {"fl_x": k.fx, "fl_y": k.fy, "cx": k.cx, "cy": k.cy}
