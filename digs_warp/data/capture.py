"""Reads a capture folder: images, depths, masks and poses of one recording, on disk.

The index is nerfstudio's ``transforms.json``, so other tools can read the folder, too; it also has our
keys. Pixels are loaded on demand. The layout is described in docs/formats.md;
`digs_warp.data.capture_writer` writes it.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import CaptureError, DigsError, require_folder
from digs_warp.data.about import About
from digs_warp.data.frame import Frame
from digs_warp.data.frame_reader import path_inside, read_frame
from digs_warp.data.gaussians import CARDS
from digs_warp.data.images import to_uint8
from digs_warp.data.index_rules import (
    INDEX_NAME,
    POINTS_KEY,
    UNDISTORT,
    check_section,
    unread_files,
)
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud, read_points
from digs_warp.data.rig import Rig
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import far_offset, rigid
from digs_warp.record import layout
from digs_warp.record.fields import Fields
from digs_warp.record.files import read_json
from digs_warp.record.typed import from_json
from digs_warp.settings import TEST_EVERY
from digs_warp.words import counted

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class MetricScale:
    """What is known about the unit of length of poses and points.

    Attributes:
        known: whether it is the metre; if not, it is arbitrary.
        because: what tells so, or what is missing.
    """

    known: bool
    because: str

    def __str__(self) -> str:
        """Say it in words, such as "unknown: the recording has no depth"."""
        return f"metres, by {self.because}" if self.known else f"unknown: {self.because}"

    @property
    def unit(self) -> str:
        """The unit of lengths, for figures: "m" or "units"."""
        return "m" if self.known else "units"


BY_DEPTH = MetricScale(True, "the depth maps")
BY_POSES = MetricScale(True, "the poses of the recording")
SCALE_IT = "'digs-warp edit --scale' brings the result to its size"
UNKNOWN_SCALE = MetricScale(
    False,
    f"the recording has no depth, and nothing says that its poses are in metres; {SCALE_IT}",
)


# Frames per second where nobody gives times.
FRAME_RATE = 30.0

# Floats of an image may overshoot 1 by this: filters and compression do.
FLOAT_SLACK = 0.1

OF_A_CAMERA = "'digs-warp convert FOLDER --from FORM --out CAPTURE' makes one of a real recording."


@dataclass(frozen=True, eq=False, repr=False)
class Capture:
    """A recording: its frames in order of time, the rig (if stereo), and facts about the recording.

    ``stored_in`` is the folder it was read from; None if it was made in memory. ``points`` are the sparse
    points that came with the recording, in its world, or their file; None: there are none. ``held_out`` are
    the names of the frames that a reconstruction of it held out; None: any frame may be. ``shift`` was taken
    off the poses as they were read, and is taken off the points [m].
    """

    stored_in: Path | None
    frames: tuple[Frame, ...]
    rig: Rig | None
    about: About = field(default_factory=About)
    points: Path | PointCloud | None = None
    held_out: frozenset[str] | None = None
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __len__(self) -> int:
        return len(self.frames)

    @staticmethod
    def from_arrays(
        color: Sequence[np.ndarray] | np.ndarray,
        depth: Sequence[np.ndarray] | np.ndarray | None,
        poses: Sequence[np.ndarray] | np.ndarray | None,
        intrinsics: Intrinsics | Sequence[Intrinsics] | np.ndarray,
        masks: Sequence[np.ndarray] | np.ndarray | None = None,
        confidence: Sequence[np.ndarray] | np.ndarray | None = None,
    ) -> "Capture":
        """Return a recording in memory; a frame for each image, in order of time.

        Args:
            color: sRGB images, (height, width, 3): uint8, or floats in 0..1.
            depth: planar depth [m] in the same pixels, (height, width), floats; 0, negative and not finite:
                unknown. None: photographs only.
            poses: ``world_from_cam`` [m], (4, 4), OpenCV axes (x right, y down, z forward). None: unknown.
            intrinsics: of all images, or one for each; or K, (3, 3), with the first pixel center at
                (0.5, 0.5), else see `Intrinsics.from_matrix`.
            masks: the object, (height, width): bool, uint8 of 0..255, or floats in 0..1.
            confidence: of the depth, (height, width), as masks.

        Raises:
            CaptureError: arrays that do not belong together, or values in another unit; names the frame.
        """
        count = len(color)
        if not count:
            raise CaptureError("arrays: no images")
        given = {"depth": depth, "poses": poses, "masks": masks, "confidence": confidence}
        if isinstance(intrinsics, np.ndarray):
            height, width = np.shape(color[0])[:2]
            intrinsics = Intrinsics.from_matrix(intrinsics, width, height)
        cameras = [intrinsics] * count if isinstance(intrinsics, Intrinsics) else intrinsics
        for name, values in {**given, "intrinsics": cameras}.items():
            if values is not None and len(values) != count:
                raise CaptureError(f"arrays: {len(values)} of {name}, expected {count} as of color")
        images = {Layer.IMAGE: color, Layer.DEPTH: depth, Layer.MASK: masks}
        images[Layer.CONFIDENCE] = confidence
        frames = []
        for number, k in enumerate(cameras):
            where = f"arrays: frame {number}"
            layers = {
                layer: _pixels(layer, np.asarray(values[number]), k, where)
                for layer, values in images.items()
                if values is not None
            }
            try:
                camera = Camera(k, np.eye(4) if poses is None else np.asarray(poses[number]))
            except DigsError as error:
                raise CaptureError(f"{where}: {error}") from None
            frames.append(Frame(f"{number:04d}", camera, number / FRAME_RATE, layers))
        known = poses is not None
        moved, shift = near_origin(tuple(frames))
        offset = shift if any(shift) else None
        about = About(poses_known=known, poses_in_metres=known, world_offset=offset)
        return Capture(None, moved, None, about)

    def __repr__(self) -> str:
        sizes = {(f.camera.intrinsics.width, f.camera.intrinsics.height) for f in self.frames}
        size = "x".join(map(str, sizes.pop())) if len(sizes) == 1 else "several sizes"
        layers = {layer.label for frame in self.frames for layer in frame.layers}
        return f"<{self}: {counted(len(self), 'frame')} of {size}, {', '.join(sorted(layers))}>"

    def _repr_html_(self) -> str:
        return import_module(CARDS).capture_card(self)

    def __str__(self) -> str:
        return "capture in memory" if self.stored_in is None else f"capture '{self.stored_in}'"

    @property
    def folder(self) -> Path:
        """The capture's folder.

        Raises:
            CaptureError: it has none because it was made in memory.
        """
        if self.stored_in is None:
            raise CaptureError(f"{self}: this needs a capture folder; simulate with out=FOLDER")
        return self.stored_in

    @property
    def right_offset(self) -> float | None:
        """Where right images are taken, along the x axis of the left camera [m]; None: there are none."""
        is_pair = self.rig is not None and self.rig.infrared is None
        return self.rig.baseline if self.rig and is_pair else None

    @property
    def has_depth(self) -> bool:
        """Whether any frame has a depth map."""
        return any(frame.has(Layer.DEPTH) for frame in self.frames)

    @property
    def metric_scale(self) -> MetricScale:
        """Whether the poses are in metres: depth is, and poses that go with it; else the recorder says it."""
        if self.has_depth:
            return BY_DEPTH
        return BY_POSES if self.about.poses_in_metres else UNKNOWN_SCALE

    @property
    def knows_poses(self) -> bool:
        """Whether the poses are valid: a recording without poses has the identity in every frame."""
        return self.about.poses_known is not False

    def load_points(self) -> PointCloud | None:
        """Return the sparse points that came with the recording, in its world, or None.

        Raises:
            DigsError: the file cannot be read.
        """
        if not isinstance(self.points, Path):
            return self.points
        return read_points(self.points, np.array(self.shift))

    @property
    def readout_time(self) -> float:
        """Time from the first row of an image to the last [s]; 0 if the recorder does not give it."""
        return self.about.readout_time or 0.0

    def split(self, test_every: int = 8) -> tuple[list[Frame], list[Frame]]:
        """Return (training, test) frames: ``held_out``, or the middle one of every ``test_every`` frames.

        The middle lies between others that are trained on. What only the first or last frames of a walk see
        is therefore seen in the training.

        Raises:
            DigsError: ``test_every`` is below 2, which would leave nothing to train on.
        """
        TEST_EVERY.check("--test-every", test_every)
        count = -(-len(self) // test_every)
        aside = {int((group + 0.5) * len(self) / count) for group in range(count)}
        if self.held_out is not None:
            aside = {i for i, frame in enumerate(self.frames) if frame.name in self.held_out}
        training = [frame for i, frame in enumerate(self.frames) if i not in aside]
        return training, [self.frames[i] for i in sorted(aside)]


def _pixels(layer: Layer, values: np.ndarray, k: Intrinsics, where: str) -> np.ndarray:
    """Return an array as its file would hold it: 8 bits, or metres."""
    where = f"{where}, {layer.label}"
    shape = (k.height, k.width, 3) if layer is Layer.IMAGE else (k.height, k.width)
    if values.shape != shape:
        raise CaptureError(f"{where}: shape {values.shape}, expected {shape} as its camera says")
    if layer is Layer.DEPTH:
        if values.dtype.kind != "f":
            raise CaptureError(
                f"{where}: {values.dtype}, expected floats in metres; millimetres become them by / 1000.0"
            )
        return values.astype(np.float32)
    if values.dtype.kind == "f" and np.nanmax(values, initial=0.0) > 1 + FLOAT_SLACK:
        raise CaptureError(
            f"{where}: floats up to {np.nanmax(values):g}, expected 0 to 1; give 0 to 255 as uint8"
        )
    if values.dtype.kind in "fb":
        return to_uint8(values.astype(np.float32))
    if values.dtype != np.uint8:
        raise CaptureError(f"{where}: {values.dtype}, expected uint8, or floats in 0 to 1")
    return values


def object_alone(capture: Capture) -> Capture:
    """Return the recording with the image and depth of what the masks show, and of nothing else."""
    return replace(capture, frames=tuple(replace(frame, alone=True) for frame in capture.frames))


def read_capture(folder: Path) -> Capture:
    """Open a capture folder; pixels stay on disk until a frame loads them.

    Raises:
        CaptureError: no or broken index, no frames, missing files, unusable poses or intrinsics, or a
            path that leaves the folder. The message names the frame and the key.
    """
    folder = require_folder(folder, "capture", f"'digs-warp simulate' writes one. {OF_A_CAMERA}")
    if not (folder / INDEX_NAME).is_file():
        raise CaptureError(f"capture '{folder}': no {INDEX_NAME} in it. {_what_it_is(folder)}")
    index = read_json(folder / INDEX_NAME, "capture index")
    entries = index.get("frames")
    if not isinstance(entries, list) or not entries:
        raise CaptureError(f"capture '{folder}': {INDEX_NAME} lists no frames")
    ours = index.get("digs_warp", {})
    where = f"capture '{folder}', digs_warp in {INDEX_NAME}"
    if not isinstance(ours, dict):
        raise CaptureError(f"{where}: expected a JSON object, found {type(ours).__name__}")
    check_section(ours, where)
    rig = (
        from_json(Rig, ours["rig"], f"{where}, rig", error=CaptureError) if "rig" in ours else None
    )
    about = from_json(About, ours, where, error=CaptureError)
    frames = tuple(read_frame(folder, index, entry, i) for i, entry in enumerate(entries))
    for note, count in unread_files([index, *entries], [layer.value for layer in Layer]).items():
        logger.warning(
            "%s: %s (%s); %s may know them",
            *(f"capture '{folder}'", note, counted(count, "frame"), UNDISTORT),
        )
    _check_names_differ(folder, frames)
    frames, shift = near_origin(frames)
    if any(shift):
        logger.warning("capture '%s': %s", folder, OFFSET_TAKEN.format(shift))
        before = about.world_offset or (0.0, 0.0, 0.0)
        total = tuple(map(sum, zip(before, shift, strict=True)))
        about = replace(about, world_offset=total)
    return Capture(folder, frames, rig, about, _points_file(folder, index), shift=shift)


OFFSET_TAKEN = "places are far from the origin; {} m are taken off, and kept as world_offset"


def near_origin(frames: tuple[Frame, ...]) -> tuple[tuple[Frame, ...], tuple[float, float, float]]:
    """Return frames whose cameras are near the origin, and what was taken off their places [m]."""
    offset = far_offset(np.stack([frame.camera.center_world for frame in frames]))
    if offset is None:
        return frames, (0.0, 0.0, 0.0)
    matrix = rigid(np.eye(3), -offset)
    moved = tuple(
        replace(f, camera=replace(f.camera, world_from_cam=matrix @ f.camera.world_from_cam))
        for f in frames
    )
    return moved, tuple(offset.tolist())


def _points_file(folder: Path, index: dict[str, Any]) -> Path | None:
    """Return the file of sparse points; other programs' indices may name one that was not copied."""
    where = f"capture '{folder}', {INDEX_NAME}"
    name = Fields(index, where, CaptureError).text(POINTS_KEY, "")
    path = path_inside(folder, name, f"{where}, {POINTS_KEY}")
    return path if name and path.is_file() else None


def _check_names_differ(folder: Path, frames: Sequence[Frame]) -> None:
    """Masks, renders and cameras of a frame are found again by its name."""
    first: dict[str, int] = {}
    for number, frame in enumerate(frames):
        if first.setdefault(frame.name, number) != number:
            raise CaptureError(
                f"capture '{folder}': frames {first[frame.name]} and {number} are both named '{frame.name}' "
                "after their images; rename one of the files, or leave one of the frames out"
            )


def _what_it_is(folder: Path) -> str:
    """Return what a folder without an index is, and what to do, in sentences."""
    if others := sorted(path.name for path in folder.glob("transforms_*.json")):
        return f"It has {', '.join(others)}: {UNDISTORT} reads the first of train, test and val."
    if (folder / layout.CAPTURE / INDEX_NAME).is_file():
        return (
            f"It holds the results of 'digs-warp run'; its capture is '{folder / layout.CAPTURE}'."
        )
    if (folder / layout.GAUSSIANS).is_file():
        return "It holds the results of 'digs-warp reconstruct'; name the capture that they are of."
    if (folder / layout.RUN_RECORD).is_file():
        return "A command was interrupted here; run it again with --resume."
    return f"'digs-warp simulate' writes one. {OF_A_CAMERA}"
