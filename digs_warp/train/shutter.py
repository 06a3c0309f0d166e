"""How cameras moved while rows were read and shutters open, and whether the training draws that.

The motion of a frame is what the recording tells (a gyroscope, a simulation), else what the poses just before
and after it say; those are of use only in a video, for a hand shakes several times a second.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.rig import CameraMotion
from digs_warp.geometry.rigid import transform_points
from digs_warp.record.typed import NOT_STORED
from digs_warp.splat.camera_motion import Blur, RowMotion
from digs_warp.words import counted

logger = logging.getLogger(__name__)

# Points of the object that tell how far its image moves.
POINTS = 200

# Neighboring poses further apart than this [s] say nothing about the motion in between: a hand shakes at up
# to 12 Hz, most below 3 Hz.
LONGEST_GAP = 0.15

Drawn = Literal["auto", "on", "off"]


@dataclass(frozen=True)
class _Effect:
    """What moves the image in a time, in words."""

    flag: str  # that says whether it is drawn
    meanwhile: str
    time: str
    gives: str  # what gives that time
    worth: float  # it is drawn where the image moves by as much [px]


# Less is not worth the two percent that a step costs.
_ROWS = _Effect(
    "--rolling-shutter", "the rows are read", "read-out time", "--readout-time", worth=0.1
)
# Recordings with less blur gain three times as much from twice the steps; of three objects with 2 px and
# more, two gained more from drawing it (docs/training.md).
_BLUR = _Effect(
    "--motion-blur", "the shutter is open", "exposure time", "the setting exposure_time", worth=2.0
)


@dataclass(frozen=True)
class MotionPlan:
    """Whether the training draws how cameras moved in a time of theirs, and why."""

    drawn: bool
    because: str
    seconds: float = 0.0  # the longest time
    # How far the object's image moves meanwhile [px], median over the frames whose motion is known.
    moved_px: float | None = None
    # Of these frames, by name.
    motions: Annotated[Mapping[str, Blur], NOT_STORED] = field(
        default_factory=dict, repr=False, compare=False
    )

    def __str__(self) -> str:
        return f"{'drawn' if self.drawn else 'not drawn'}: {self.because}"


NO_MOTION = MotionPlan(False, "all at once")


@dataclass(frozen=True)
class Shutter:
    """What moves while the rows are read, and while the shutter is open."""

    rows: MotionPlan = NO_MOTION
    blur: MotionPlan = NO_MOTION

    def rows_of(self, frame: Frame) -> RowMotion | None:
        """Return how the camera of a frame moves while its rows are read; None: it is not drawn."""
        motion = frame.exposure.camera_motion
        return _in_time(motion, self.rows.seconds) if self.rows.drawn and motion else None

    def blur_of(self, frame: Frame) -> Blur | None:
        """Return how it moves while the shutter is open; None: the photograph is drawn sharp."""
        found = self.blur.motions.get(frame.name) if self.blur.drawn else None
        return found if found and found.moments > 1 else None

    @property
    def moments(self) -> int:
        """From how many poses a photograph is drawn at most."""
        found = self.blur.motions.values() if self.blur.drawn else ()
        return max((blur.moments for blur in found), default=1)


NO_SHUTTER = Shutter()


def plan_rows(
    frames: Sequence[Frame], points: np.ndarray, readout_time: float, setting: Drawn
) -> MotionPlan:
    """Decide by how far the image of the points moves while the rows are read.

    Args:
        frames: of the recording, with their motions, see `with_motions`.
        points: on the object, in the world, shape (n, 3).
        readout_time: from the first row to the last [s]; 0: all rows at once.
        setting: auto decides; on and off do not.

    Raises:
        DigsError: "on", and the recording does not tell what it takes, or contradicts itself.
    """
    return _plan(_ROWS, frames, points, [readout_time] * len(frames), setting)


def plan_blur(
    frames: Sequence[Frame], points: np.ndarray, exposure_time: float | None, setting: Drawn
) -> MotionPlan:
    """Decide by how far it moves while the shutter is open; arguments and errors as of `plan_rows`.

    ``exposure_time``: of every row [s]; None: those that the frames tell.
    """
    times = [f.exposure.exposure_time if exposure_time is None else exposure_time for f in frames]
    plan = _plan(_BLUR, frames, points, times, setting)
    several = [blur.moments for blur in plan.motions.values() if blur.moments > 1]
    if not plan.drawn:
        return plan
    words = f"; {counted(len(several), 'frame')} drawn from up to {max(several, default=1)} poses"
    return replace(plan, drawn=bool(several), because=plan.because + (words if several else ""))


def _plan(
    effect: _Effect,
    frames: Sequence[Frame],
    points: np.ndarray,
    times: Sequence[float | None],
    setting: Drawn,
) -> MotionPlan:
    if setting == "off":
        return MotionPlan(False, f"{effect.flag} off")
    longest = max((time or 0.0 for time in times), default=0.0)
    obstacle = _obstacle(effect, frames, longest)
    if obstacle is not None:
        if setting == "on":
            raise DigsError(f"{effect.flag} on: {obstacle}")
        if longest > 0:
            logger.warning("%s: not drawn: %s", effect.flag, obstacle)
        return MotionPlan(False, obstacle, longest)
    some = points[:: max(1, len(points) // POINTS)]
    motions = {}
    for frame, time in zip(frames, times, strict=True):
        motion, speeds = frame.exposure.camera_motion, image_speed(frame, some)
        if motion is not None and len(speeds) and time is not None:
            motions[frame.name] = Blur(_in_time(motion, time), time * float(np.median(speeds)))
    typical = float(np.median([each.pixels for each in motions.values()] or [0.0]))
    because = f"the image moves {typical:.2f} px while {effect.meanwhile} (median)"
    if setting == "auto" and typical < effect.worth:
        because += f"; less than {effect.worth:g} px are not worth drawing"
        return MotionPlan(False, because, longest, typical)
    return MotionPlan(True, because, longest, typical, motions)


def _obstacle(effect: _Effect, frames: Sequence[Frame], longest: float) -> str | None:
    """Return why a motion cannot be drawn; None: it can."""
    if longest == 0:
        return f"the recording tells no {effect.time}, or 0; {effect.gives} gives it"
    if all(frame.exposure.camera_motion is None for frame in frames):
        return (
            f"nothing tells how the cameras of {counted(len(frames), 'frame')} moved: no camera_motion, "
            f"and poses more than {LONGEST_GAP:g} s apart"
        )
    gaps = np.diff(sorted(frame.time for frame in frames))
    if len(gaps) and 0 < gaps.min() < longest:
        return (
            f"a {effect.time} of {longest:g} s is longer than the {gaps.min():g} s between two frames; "
            f"correct the times of the recording or {effect.gives}"
        )
    return None


def _in_time(motion: CameraMotion, seconds: float) -> RowMotion:
    return RowMotion(
        seconds * np.array(motion.angular_velocity), seconds * np.array(motion.velocity)
    )


def image_speed(frame: Frame, points: np.ndarray) -> np.ndarray:
    """Return how fast points before the camera move on the image [px/s], shape (m,); none without a motion.

    Args:
        frame: its camera, and the motion of that.
        points: in the world, shape (n, 3).
    """
    motion = frame.exposure.camera_motion
    if motion is None:
        return np.zeros(0)
    seen = transform_points(frame.camera.cam_from_world, points.astype(np.float64))
    x, y, z = seen[seen[:, 2] > 0].T
    moving = (
        -np.array(motion.velocity)[:, None]
        - np.cross(np.array(motion.angular_velocity), np.stack([x, y, z], axis=1)).T
    )
    k = frame.camera.intrinsics
    u = k.fx * (moving[0] - x / z * moving[2]) / z
    v = k.fy * (moving[1] - y / z * moving[2]) / z
    return np.hypot(u, v)


def with_motions(frames: Sequence[Frame]) -> list[Frame]:
    """Return frames, in the same order, with the motion that their neighbors tell where none is recorded."""
    by_time = sorted(range(len(frames)), key=lambda index: frames[index].time)
    found = list(frames)
    for place, index in enumerate(by_time):
        around = by_time[max(place - 1, 0) : place + 2]
        frame = frames[index]
        if frame.exposure.camera_motion is None:
            motion = _motion_between(frames[around[0]], frame, frames[around[-1]])
            found[index] = replace(frame, exposure=replace(frame.exposure, camera_motion=motion))
    return found


def _motion_between(before: Frame, frame: Frame, after: Frame) -> CameraMotion | None:
    """Return the mean motion of a frame's camera from one frame to another; None: too far apart."""
    from scipy.spatial.transform import Rotation

    span = after.time - before.time
    if not 0 < span <= 2 * LONGEST_GAP:
        return None
    first, own, last = (each.camera.world_from_cam for each in (before, frame, after))
    turn = Rotation.from_matrix(first[:3, :3].T @ last[:3, :3]).as_rotvec()
    shift = own[:3, :3].T @ (last[:3, 3] - first[:3, 3])
    return CameraMotion.of(shift / span, turn / span)
