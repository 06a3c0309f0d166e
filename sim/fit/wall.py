"""A recording of a flat wall: frames of a camera at rest, at several distances, as stacks of disparity.

The frames are those of the eye that measures depth: the camera of the frame, or the left infrared eye beside
it. There depth is registered to the color camera; it is looked up from the eye along the plane of the wall,
so that noise, static field and drift are found where they arise.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.rig import InfraredPair, Rig
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.progress import progress
from digs_warp.sim.fit.known_frame import is_gray
from digs_warp.sim.fit.plane import Plane, fit_plane
from digs_warp.sim.sensor.infrared.pair import in_three_channels
from digs_warp.words import counted


@dataclass(frozen=True, eq=False)
class WallFrame:
    """A frame of the eye.

    Attributes:
        name: of the frame.
        image: of the eye, sRGB, (height, width, 3), uint8; equal channels of an infrared eye.
        disparity: as the camera reports it [px], (height, width), float32, NaN where it has none.
        looked: where depth could be: in the mask and in the image of the camera that reports it, bool.
        color: of the color camera beside an infrared pair; None: there is none.
    """

    name: str
    image: np.ndarray
    disparity: np.ndarray
    looked: np.ndarray
    color: np.ndarray | None


def eye_of(color: Intrinsics, rig: Rig | None) -> Intrinsics:
    """Return the camera of the eye; ``color`` is that of the frames."""
    if rig is None or rig.infrared is None:
        return color
    pair = rig.infrared
    return Intrinsics(color.width, color.height, pair.fl_x, pair.fl_y, pair.cx, pair.cy)


def load_frames(capture: Capture, focal_baseline: float) -> Iterator[WallFrame]:
    """Yield the frames of a recording of a wall.

    Args:
        capture: its frames have depth, and those of an infrared pair its images.
        focal_baseline: of the eye [px m].

    Raises:
        DigsError: a frame that lacks one of these, or has another camera than the first.
    """
    first = capture.frames[0].camera.intrinsics
    for frame in capture.frames:
        where = f"{capture}, frame '{frame.name}'"
        if not frame.has(Layer.DEPTH):
            raise DigsError(
                f"{where}: no depth; expected depth as the camera reports it. Record "
                "it, or convert the recording with its depth"
            )
        if frame.camera.intrinsics != first:
            raise DigsError(
                f"{where}: another camera than that of the first frame; fit the "
                "recordings of each camera alone"
            )
        if capture.rig is not None and capture.rig.infrared is not None:
            yield _of_infrared(frame, capture.rig.infrared, focal_baseline, where)
        else:
            yield _of_left(frame, focal_baseline)


def _of_left(frame: Frame, focal_baseline: float) -> WallFrame:
    mask = _mask(frame)
    disparity = np.float32(focal_baseline) / _depth(frame, mask)
    return WallFrame(frame.name, frame.load_image(), disparity, looked=mask, color=None)


def _of_infrared(frame: Frame, pair: InfraredPair, focal_baseline: float, where: str) -> WallFrame:
    for layer in (Layer.INFRARED_LEFT, Layer.INFRARED_RIGHT):
        if not frame.has(layer):
            raise DigsError(
                f"{where}: no {layer.label}; expected both images of the infrared pair that the capture "
                "names. Record them, or take 'infrared' out of its rig to fit the color camera alone"
            )
    mask = _mask(frame)
    depth = _depth(frame, mask)
    row, column, inside = _in_color(depth, frame.camera.intrinsics, pair, focal_baseline)

    def seen(image: np.ndarray, outside: float) -> np.ndarray:
        # Taken as it is: both cameras look the same way, so that depth is the same.
        return np.where(inside, image[row, column], image.dtype.type(outside))

    return WallFrame(
        frame.name,
        image=in_three_channels(frame.load_infrared()[0]),
        disparity=np.float32(focal_baseline) / seen(depth, np.nan),
        looked=seen(mask, 0),
        color=frame.load_image(),
    )


def _mask(frame: Frame) -> np.ndarray:
    if frame.has(Layer.MASK):
        return frame.load_mask() >= 128
    k = frame.camera.intrinsics
    return np.ones((k.height, k.width), bool)


def _depth(frame: Frame, mask: np.ndarray) -> np.ndarray:
    return np.where(mask, frame.load_depth(), np.float32(np.nan))


def _in_color(
    depth: np.ndarray, k: Intrinsics, pair: InfraredPair, focal_baseline: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the pixel of the color image that shows each pixel of the left infrared eye.

    1 / Z of a plane is affine in the pixels of the color camera, so that they follow directly.

    Args:
        depth: of a wall, registered to the color camera [m], (height, width), float32, NaN where unknown.
        k: of the color camera.
        pair: the infrared eyes.
        focal_baseline: of the eye [px m].

    Returns:
        Rows, columns, and whether they are in the image; (height, width) each. Without a wall: in none.
    """
    height, width = depth.shape
    plane = fit_plane(focal_baseline / depth)
    a, b, c = np.full(3, np.nan) if plane is None else plane.coefficients / focal_baseline
    rows = ((np.arange(height) + 0.5 - pair.cy) / pair.fl_y * k.fy + k.cy)[:, None]
    # u = straight + shift / Z(u, v), where 1 / Z = a u + b v + c.
    straight = (np.arange(width) + 0.5 - pair.cx) / pair.fl_x * k.fx + k.cx
    shift = k.fx * pair.offset
    columns = (straight + shift * (b * rows + c)) / (1 - shift * a)
    rows, columns = np.broadcast_arrays(rows, columns)
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    row, column = (np.where(inside, each, 0).astype(int) for each in (rows, columns))
    return row, column, inside


# More frames of a pose add little, and all of them are held in memory.
MOST_FRAMES = 10

# Frames belong to one pose of the camera if their planes differ by no more than this anywhere [px].
SAME_POSE = 0.3

# Share of the known pixels that have to lie on the plane.
FLAT = 0.6

_ADVICE = "record a flat, textured wall that fills the image"


@dataclass(frozen=True, eq=False)
class Pose:
    """Frames of the wall from one place.

    Attributes:
        plane: of their mean disparity.
        disparity: as the camera reports it [px], (frames, height, width), float32, NaN where it has none.
        images: left images, sRGB, (frames, height, width, 3), uint8.
        looked: where depth could be, (height, width), bool: in the mask, in the image that depth belongs to.
        color: images of the color camera beside an infrared pair, like ``images``; None: there is none.
    """

    plane: Plane
    disparity: np.ndarray
    images: np.ndarray
    looked: np.ndarray
    color: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Wall:
    """A recording of a wall.

    Attributes:
        intrinsics: of the left eye.
        baseline: [m].
        poses: from the nearest to the farthest.
        color_camera: `StereoRig.color_offset` [m] and `color_zoom` of that beside an infrared pair; None: the
            left eye takes the images.
    """

    intrinsics: Intrinsics
    baseline: float
    poses: tuple[Pose, ...]
    color_camera: tuple[float, float] | None = None

    @property
    def focal_baseline(self) -> float:
        """Focal length times baseline [px m]."""
        return self.intrinsics.fx * self.baseline

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the images [px]."""
        return self.intrinsics.height, self.intrinsics.width

    @property
    def is_gray(self) -> bool:
        """Whether the eyes see no color."""
        return all(is_gray(pose.images) for pose in self.poses)

    def distance(self, pose: Pose) -> float:
        """Return the depth of the plane on the optical axis [m]."""
        k, (a, b, c) = self.intrinsics, pose.plane.coefficients
        return self.focal_baseline / (a * k.cx + b * k.cy + c)


def read_wall(capture: Capture, baseline: float) -> Wall:
    """Read the frames of a capture and sort them by pose: neighbors in time with the same plane are one.

    Args:
        capture: its frames have depth. Where it names an infrared pair, the wall is that of the left infrared
            eye.
        baseline: [m], where the capture does not give one.

    Raises:
        DigsError: a frame without depth, or one that shows no flat wall.
    """
    color = capture.frames[0].camera.intrinsics
    intrinsics = eye_of(color, capture.rig)
    baseline = capture.rig.baseline if capture.rig else baseline
    focal_baseline = intrinsics.fx * baseline
    groups: list[tuple[Plane, list[WallFrame]]] = []
    with progress(len(capture), "Reading", "frame") as bar:
        for loaded in load_frames(capture, focal_baseline):
            plane = _plane_of(loaded.disparity, f"{capture}, frame '{loaded.name}'")
            if groups and _differ(groups[-1][0], plane, loaded.disparity.shape) <= SAME_POSE:
                if len(groups[-1][1]) < MOST_FRAMES:
                    groups[-1][1].append(loaded)
            else:
                groups.append((plane, [loaded]))
            bar.update()
    poses = [_pose(capture, loaded) for _, loaded in groups]
    pair = capture.rig.infrared if capture.rig else None
    color_camera = None if pair is None else (-pair.offset, color.fx / pair.fl_x)
    wall = Wall(intrinsics, baseline, (), color_camera)
    return replace(wall, poses=tuple(sorted(poses, key=wall.distance)))


def _plane_of(disparity: np.ndarray, where: str) -> Plane:
    plane = fit_plane(disparity)
    if plane is None:
        raise DigsError(
            f"{where}: hardly any pixel has depth; {_ADVICE}, within the camera's range"
        )
    if plane.share < FLAT:
        raise DigsError(
            f"{where}: {plane.share:.0%} of the pixels lie within {plane.limit:.1f} px of a plane, expected "
            f"{FLAT:.0%} or more; {_ADVICE}, or add masks of the wall"
        )
    return plane


def _differ(first: Plane, second: Plane, shape: tuple[int, int]) -> float:
    """Return the largest difference of two planes in an image: it is in a corner [px]."""
    corners = np.ix_((0, -1), (0, -1))
    return float(np.abs(first.disparity(shape) - second.disparity(shape))[corners].max())


def make_pose(
    name: str,
    disparity: np.ndarray,
    images: np.ndarray,
    looked: np.ndarray,
    color: np.ndarray | None = None,
) -> Pose:
    """Return a pose with the plane of its mean disparity; ``name`` is for messages."""
    count = np.isfinite(disparity).sum(axis=0)
    mean = np.nansum(disparity, axis=0, dtype=np.float64) / np.where(count, count, np.nan)
    return Pose(_plane_of(mean, name), disparity, images, looked, color)


def _pose(capture: Capture, frames: list[WallFrame]) -> Pose:
    colors = [frame.color for frame in frames if frame.color is not None]
    return make_pose(
        f"{capture}, frames from '{frames[0].name}' on",
        np.stack([frame.disparity for frame in frames]),
        np.stack([frame.image for frame in frames]),
        frames[0].looked,
        np.stack(colors) if colors else None,
    )


def describe(wall: Wall) -> str:
    """Return what was recorded, in a phrase."""
    places = ", ".join(f"{wall.distance(pose):.2f}" for pose in wall.poses)
    frames = sum(len(pose.disparity) for pose in wall.poses)
    return f"{counted(frames, 'frame')} of a wall at {places} m"
