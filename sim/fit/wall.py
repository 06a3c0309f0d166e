"""A recording of a flat wall: frames of a camera at rest, at several distances, as stacks of disparity."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from digs_warp.camera import Intrinsics
from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.record.progress import progress
from digs_warp.sim.fit.plane import Plane, fit_plane
from digs_warp.words import counted

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
        true: true disparity [px], (height, width), float32; None: not known.
        right: right image of the first frame, (height, width, 3), uint8; None: not recorded.
    """

    plane: Plane
    disparity: np.ndarray
    images: np.ndarray
    true: np.ndarray | None
    right: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Wall:
    """A recording of a wall.

    Attributes:
        intrinsics: of the left eye.
        baseline: [m].
        poses: from the nearest to the farthest.
    """

    intrinsics: Intrinsics
    baseline: float
    poses: tuple[Pose, ...]

    @property
    def focal_baseline(self) -> float:
        """Focal length times baseline [px m]."""
        return self.intrinsics.fx * self.baseline

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the images [px]."""
        return self.intrinsics.height, self.intrinsics.width

    def distance(self, pose: Pose) -> float:
        """Return the depth of the plane on the optical axis [m]."""
        k, (a, b, c) = self.intrinsics, pose.plane.coefficients
        return self.focal_baseline / (a * k.cx + b * k.cy + c)


def read_wall(capture: Capture, baseline: float) -> Wall:
    """Read the frames of a capture and sort them by pose: neighbors in time with the same plane are one.

    Args:
        capture: its frames have depth.
        baseline: [m], where the capture does not give one.

    Raises:
        DigsError: a frame without depth, or one that shows no flat wall.
    """
    intrinsics = capture.frames[0].camera.intrinsics
    baseline = capture.rig.baseline if capture.rig else baseline
    focal_baseline = intrinsics.fx * baseline
    groups: list[tuple[Plane, list[_Loaded]]] = []
    with progress(len(capture), "Reading", "frame") as bar:
        for loaded in _load(capture, focal_baseline):
            plane = _plane_of(loaded.disparity, f"{capture}, frame '{loaded.name}'")
            if groups and _differ(groups[-1][0], plane, loaded.disparity.shape) <= SAME_POSE:
                if len(groups[-1][1]) < MOST_FRAMES:
                    groups[-1][1].append(loaded)
            else:
                groups.append((plane, [loaded]))
            bar.update()
    poses = [_pose(capture, loaded) for _, loaded in groups]
    wall = Wall(intrinsics, baseline, ())
    return Wall(intrinsics, baseline, tuple(sorted(poses, key=wall.distance)))


@dataclass(frozen=True, eq=False)
class _Loaded:
    name: str
    image: np.ndarray
    disparity: np.ndarray
    true: np.ndarray | None
    right: np.ndarray | None


def _load(capture: Capture, focal_baseline: float) -> Iterator[_Loaded]:
    first = capture.frames[0].camera.intrinsics
    for frame in capture.frames:
        if not frame.has(Layer.DEPTH):
            raise DigsError(
                f"{capture}, frame '{frame.name}': no depth; expected depth as the camera reports it. Record "
                "it, or give a stereo pair with true disparity"
            )
        if frame.camera.intrinsics != first:
            raise DigsError(
                f"{capture}, frame '{frame.name}': another camera than that of the first frame; fit the "
                "recordings of each camera alone"
            )
        disparity = np.float32(focal_baseline) / frame.load_depth()
        if frame.has(Layer.MASK):
            disparity[frame.load_mask() < 128] = np.nan
        right = frame.load_right_image() if frame.has(Layer.RIGHT) else None
        true = _true(frame, focal_baseline)
        yield _Loaded(frame.name, frame.load_image(), disparity, true, right)


def _true(frame: Frame, focal_baseline: float) -> np.ndarray | None:
    if not frame.has(Layer.DEPTH_TRUE):
        return None
    return np.float32(focal_baseline) / frame.load_depth_true()


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
    true: np.ndarray | None,
    right: np.ndarray | None = None,
) -> Pose:
    """Return a pose with the plane of its mean disparity; ``name`` is for messages."""
    count = np.isfinite(disparity).sum(axis=0)
    mean = np.nansum(disparity, axis=0, dtype=np.float64) / np.where(count, count, np.nan)
    return Pose(_plane_of(mean, name), disparity, images, true, right)


def _pose(capture: Capture, frames: list[_Loaded]) -> Pose:
    return make_pose(
        f"{capture}, frames from '{frames[0].name}' on",
        np.stack([frame.disparity for frame in frames]),
        np.stack([frame.image for frame in frames]),
        frames[0].true,
        frames[0].right,
    )


def describe(wall: Wall) -> str:
    """Return what was recorded, in a phrase."""
    places = ", ".join(f"{wall.distance(pose):.2f}" for pose in wall.poses)
    frames = sum(len(pose.disparity) for pose in wall.poses)
    return f"{counted(frames, 'frame')} of a wall at {places} m"
