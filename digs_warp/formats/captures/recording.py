"""What the readers of other programs' folders return, and how they read the small files in these."""

import logging
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import CaptureError, DigsError
from digs_warp.data.capture import FRAME_RATE
from digs_warp.data.file_names import folder_named, masks_in
from digs_warp.data.images import MM_PER_METRE, image_size
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.viewpoints import spread
from digs_warp.formats.captures.lens import PinholeView
from digs_warp.formats.table import FORMS
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import matrix_from_quat_xyzw, rigid
from digs_warp.record.files import read_text
from digs_warp.words import counted, first_few

logger = logging.getLogger(__name__)

# Kinds of files that are not read and named at once.
MOST_UNREAD = 8

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
# Floats first: beside them, a PNG is often a picture of the depth.
DEPTH_SUFFIXES = (".exr", ".npy", ".npz", ".tiff", ".tif", ".pgm", ".png")


@dataclass(frozen=True, eq=False)
class RecordedFrame:
    """One moment of a recording, in the files that another program wrote.

    Attributes:
        image: color image, any 8-bit format.
        intrinsics: camera of the capture's image, first pixel center at (0.5, 0.5).
        time: seconds.
        world_from_cam: pose, (4, 4), OpenCV axes, metres; None if unknown.
        depth: depth image, or None.
        depth_units_per_metre: the value of a pixel one metre away in a depth image of integers.
        float_units_per_metre: the same in one of floats.
        mask: a mask, or None to use the alpha channel of the image, if it has one.
        right: image of the right eye, or None.
        view: how the image of that camera is made from the file; None: the file holds it.
        right_view: the same of its right eye; None: as ``view``.
    """

    image: Path
    intrinsics: Intrinsics
    time: float
    world_from_cam: np.ndarray | None = None
    depth: Path | None = None
    depth_units_per_metre: float = MM_PER_METRE
    float_units_per_metre: float = 1.0
    mask: Path | None = None
    right: Path | None = None
    view: PinholeView | None = None
    right_view: PinholeView | None = None

    @property
    def file_camera(self) -> Intrinsics:
        """The camera of the image file, without its lens."""
        return self.intrinsics if self.view is None else self.view.source

    def at_its_size(self) -> "RecordedFrame":
        """Return the frame with its camera at the size of its image, if both have the same shape."""
        k = self.file_camera
        try:
            width, height = image_size(self.image)
        except DigsError:  # named when it is read
            return self
        if (width, height) == (k.width, k.height) or not same_shape(k, width, height):
            return self
        sx, sy = width / k.width, height / k.height

        def scaled(k: Intrinsics) -> Intrinsics:
            return k.resized(round(k.width * sx), round(k.height * sy))

        views = {
            name: replace(view, source=scaled(view.source), target=scaled(view.target))
            for name in ("view", "right_view")
            if (view := getattr(self, name)) is not None
        }
        return replace(self, intrinsics=scaled(self.intrinsics), **views)

    def with_field_of_view(self, degrees: float) -> "RecordedFrame":
        """Return the frame with another field of view, if its image is made from that of a lens."""
        if self.view is None:
            return self
        view = self.view.with_field_of_view(degrees)
        right = self.right_view and self.right_view.with_field_of_view(degrees)
        return replace(self, intrinsics=view.target, view=view, right_view=right)


def same_shape(k: Intrinsics, width: int, height: int) -> bool:
    """Whether images of a size are those of a camera, made smaller or larger; sizes are rounded."""
    return abs(width * k.height - height * k.width) <= max(k.width, k.height)


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
        points: returns the points from which a reconstruction can start, in the world of the poses less an
            offset (3,) [m]; or None.
        notes: what was found out about it while it was read, clauses, and how often.
    """

    folder: Path
    frames: tuple[RecordedFrame, ...]
    depth_camera: DepthCamera | None = None
    baseline: float | None = None
    points: Callable[[np.ndarray], PointCloud] | None = None
    poses_in_metres: bool = True
    notes: Counter[str] = field(default_factory=Counter)

    def say_notes(self) -> None:
        """Log the notes, each once."""
        for note, count in sorted(self.notes.items()):
            often = f" ({counted(count, 'time')})" if count > 1 else ""
            logger.warning("recording '%s': %s%s", self.folder, note, often)
        self.notes.clear()

    def completed(self, form: str) -> "Recording":
        """Return the recording with the masks beside its images, and cameras of the size of those.

        What the folder of a recording of the format ``form`` holds beside becomes a note.
        """
        frames = tuple(frame.at_its_size() for frame in self.frames)
        resized = [new for new, old in zip(frames, self.frames, strict=True) if new is not old]
        if resized:
            k = resized[0].file_camera
            self.notes[f"the camera is scaled to the images, {k.width}x{k.height}"] = len(resized)
        return replace(self, frames=frames)._with_masks_beside().with_unread(form)

    def with_unread(self, form: str) -> "Recording":
        """Return the recording with a note of the files in its folder that its format does not read."""
        files = ((f.image, f.depth, f.mask, f.right) for f in self.frames)
        used = {path for each in files for path in each if path is not None}
        if unread := [*FORMS[form].unread(self.folder, used)]:
            self.notes[f"not read: {first_few(unread, MOST_UNREAD)}"] = 1
        return self

    def _with_masks_beside(self) -> "Recording":
        """Return the recording with the masks of a folder beside that of its images, if it has no others."""
        if any(frame.mask is not None for frame in self.frames):
            return self
        first = self.frames[0].image if self.frames else self.folder
        tops = [
            top for top in first.parents if top != top.parent and self.folder.parent in top.parents
        ]
        for top in tops or [first.parent.parent]:
            names = [
                "/".join(frame.image.relative_to(top).parts[1:]) or frame.image.name
                if frame.image.is_relative_to(top)
                else frame.image.name
                for frame in self.frames
            ]
            for folder in (folder_named(top, "masks"), folder_named(top, "mask")):
                found, left = masks_in(folder, names)
                if left:
                    fit = "no image" if not found else "no other image"
                    self.notes[
                        f"files in '{folder}' fit {fit}; name them like the images, 0001.png for 0001.jpg"
                    ] = left
                if found:
                    if lacking := len(set(names) - found.keys()):
                        self.notes[f"images have no mask in '{folder}'"] = lacking
                    masks = [found.get(name) for name in names]
                    pairs = zip(self.frames, masks, strict=True)
                    logger.info("recording '%s': masks are those in '%s'", self.folder, folder)
                    return replace(self, frames=tuple(replace(f, mask=m) for f, m in pairs))
        return self

    def thinned(self, count: int) -> "Recording":
        """Return the recording with at most ``count`` frames, evenly spread from the first to the last."""
        kept = spread(len(self.frames), count)
        return replace(self, frames=tuple(self.frames[number] for number in kept))

    def with_field_of_view(self, degrees: float) -> "Recording":
        """Return the recording with another horizontal field of view of its undistorted images."""
        if all(frame.view is None for frame in self.frames):
            raise CaptureError(
                f"recording '{self.folder}': its images have no lens distortion, so that --fov-deg has "
                "nothing to choose; leave it out"
            )
        frames = tuple(frame.with_field_of_view(degrees) for frame in self.frames)
        return replace(self, frames=frames)


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
    def find(folder: Path, images: str, depths: str) -> "NumberedFiles":
        """Find the files; ``images`` and ``depths`` precede the number, such as "rgb/" or "left"."""
        found = numbered_files(folder, images, IMAGE_SUFFIXES)
        if not found:
            raise CaptureError(
                f"recording '{folder}': no images {images}NUMBER.png or .jpg; is this the right --from?"
            )
        return NumberedFiles(folder, found, numbered_files(folder, depths, DEPTH_SUFFIXES))

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


@contextmanager
def expecting(where: str, what: str) -> Iterator[None]:
    """Raise a `CaptureError` when the block finds missing keys or wrong values in a file.

    Args:
        where: the file.
        what: what it should hold.
    """
    try:
        yield
    except DigsError:
        raise
    except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
        raise CaptureError(f"{where}: expected {what} ({error!r})") from None


# Clocks of a computer count from 1970; times above these are in the unit.
CLOCK_UNITS = ((1e17, 1e9, "nanoseconds"), (1e14, 1e6, "microseconds"), (1e11, 1e3, "milliseconds"))

# Of a clock that starts at 0: no two frames in a row are so far apart [s].
LONGEST_STEP = ((1e6, 1e9, "nanoseconds"), (3600.0, 1e6, "microseconds"))


def in_seconds(stamps: Sequence[float] | np.ndarray, notes: Counter[str]) -> np.ndarray:
    """Return times in seconds: their size, or the steps between them, says their unit."""
    times = np.asarray(stamps, dtype=np.float64)
    if not len(times):
        return times
    step = float(np.median(np.diff(np.unique(times)))) if len(times) > 1 else 0.0
    measures = ((np.median(np.abs(times)), CLOCK_UNITS), (step, LONGEST_STEP))
    for value, units in measures:
        for above, per_second, unit in units:
            if value > above:
                notes[f"times are in {unit}"] += 1
                return times / per_second
    return times


def known_pose(matrix: np.ndarray) -> np.ndarray | None:
    """Return a pose, (4, 4); None where the program that wrote it was lost: zeros, or not finite."""
    return matrix if np.isfinite(matrix).all() and matrix[:3, :3].any() else None


def placed(quat_xyzw: np.ndarray, place: np.ndarray) -> np.ndarray | None:
    """Return the pose of a quaternion and a place; None as of `known_pose`."""
    if not (np.isfinite(quat_xyzw).all() and np.isfinite(place).all() and quat_xyzw.any()):
        return None
    return rigid(matrix_from_quat_xyzw(quat_xyzw), place)


def read_numbers(path: Path, shape: tuple[int, ...], what: str) -> np.ndarray:
    """Return the numbers of a text file, separated by blanks or commas, without what follows #."""
    lines = read_text(path, what, errors="replace").replace(",", " ").splitlines()
    rows = [row for line in lines if (row := line.partition("#")[0].split())]
    ends = np.cumsum([0, *map(len, rows)])
    with expecting(f"{what} '{path}'", f"{shape} numbers"):
        # Rows of a table may go on in the next line, but begin with one.
        if shape[0] == -1 and not np.isin(np.arange(0, ends[-1], shape[1]), ends).all():
            raise ValueError(f"{len(rows[0])} in the first line")
        return np.array([float(word) for row in rows for word in row]).reshape(shape)


def numbered_files(
    folder: Path, start: str, suffixes: Sequence[str], end: str = ""
) -> dict[int, Path]:
    """Return the files START + NUMBER + END + SUFFIX below a folder by number, ascending; START may have a /.

    Where there are several of a number, the one whose suffix is named first counts.
    """
    place, _, prefix = start.rpartition("/")
    found = {}
    for suffix in reversed(suffixes):
        for path in folder_named(folder, place).glob(f"{prefix}*"):
            digits = path.stem.removeprefix(prefix).removesuffix(end)
            has_end = path.stem.endswith(end) and path.suffix.lower() == suffix
            if has_end and digits.isdecimal():
                found[int(digits)] = path
    return dict(sorted(found.items()))
