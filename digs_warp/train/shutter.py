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


def some_of(points: np.ndarray) -> np.ndarray:
    """Return at most about `POINTS` of the points, shape (n, 3), evenly spread over their order."""
    return points[:: max(1, len(points) // POINTS)]


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


MotionBlur = Literal["auto", "on", "off"]

# Recordings with less blur [px, median over their frames] gain three times as much from twice the steps; of
# three objects with 2 px and more, two gained more from drawing it (table in docs/training.md).
WORTH_DRAWING = 2.0


@dataclass(frozen=True)
class BlurPlan:
    """From how many poses the training draws each photograph, and why.

    Attributes:
        because: the reason, in words.
        blur_px: how far the object's image moves while the shutter is open [px], median over the frames whose
            motion is known; None: unknown.
        frames: how many are drawn from several poses.
        moments: the most poses of a frame; 1: motion blur is not drawn.
        blurs: of the frames that are drawn from several poses, by name.
    """

    because: str
    blur_px: float | None = None
    frames: int = 0
    moments: int = 1
    blurs: Annotated[Mapping[str, Blur], NOT_STORED] = field(
        default_factory=dict, repr=False, compare=False
    )

    def __str__(self) -> str:
        return f"{'drawn' if self.drawn else 'not drawn'}: {self.because}"

    @property
    def drawn(self) -> bool:
        """Whether any photograph is drawn from several poses."""
        return self.moments > 1

    def of(self, frame: Frame) -> Blur | None:
        """Return how the camera of a frame moves while its shutter is open; None: it is drawn sharp."""
        return self.blurs.get(frame.name)


NO_BLUR = BlurPlan("the shutter is open for an instant")


def plan_blur(
    frames: Sequence[Frame], points: np.ndarray, exposure_time: float | None, setting: MotionBlur
) -> BlurPlan:
    """Decide by how far the image of the points moves while the shutter is open.

    Args:
        frames: of the recording, with their motions.
        points: on the object, in the world, shape (n, 3).
        exposure_time: of every row [s]; None: those that the frames tell.
        setting: auto draws it where that pays; on wherever it shows, and is an error where it cannot; off
            does not.

    Raises:
        DigsError: "on", and the recording does not tell what it takes, or contradicts itself.
    """
    if setting == "off":
        return BlurPlan("--motion-blur off")
    times = [f.exposure.exposure_time if exposure_time is None else exposure_time for f in frames]
    obstacle = _blur_obstacle(frames, times)
    if obstacle is not None:
        if setting == "on":
            raise DigsError(f"--motion-blur on: {obstacle}")
        if any(times):
            logger.warning("motion blur is not drawn: %s", obstacle)
        return BlurPlan(obstacle)
    some = some_of(points)
    found = {}
    for frame, time in zip(frames, times, strict=True):
        speeds = image_speed(frame, some)
        if len(speeds) and time is not None:
            found[frame.name] = _blur_of(frame, time, float(np.median(speeds)))
    typical = float(np.median([blur.pixels for blur in found.values()] or [0.0]))
    said = f"the image moves {typical:.2f} px while the shutter is open (median)"
    if setting == "auto" and typical < WORTH_DRAWING:
        return BlurPlan(f"{said}; less than {WORTH_DRAWING:g} px are not worth drawing", typical)
    several = {name: blur for name, blur in found.items() if blur.moments > 1}
    most = max((blur.moments for blur in several.values()), default=1)
    if several:
        said += f"; {counted(len(several), 'frame')} drawn from up to {most} poses"
    return BlurPlan(said, typical, len(several), most, several)


def _blur_of(frame: Frame, time: float, speed: float) -> Blur:
    motion = frame.exposure.camera_motion
    assert motion is not None  # it has a speed
    turn, shift = np.array(motion.angular_velocity), np.array(motion.velocity)
    return Blur(RowMotion(time * turn, time * shift), time * speed)


def _blur_obstacle(frames: Sequence[Frame], times: Sequence[float | None]) -> str | None:
    """Return why motion blur cannot be drawn; None: it can."""
    known = [time for time in times if time is not None]
    if not any(known):
        if known:
            return "the recording tells an exposure of 0 s, in which nothing blurs"
        return "the recording tells no exposure time; the setting exposure_time gives it"
    if all(frame.exposure.camera_motion is None for frame in frames):
        return f"nothing tells how the cameras of {counted(len(frames), 'frame')} moved"
    gaps = np.diff(sorted(frame.time for frame in frames))
    if len(gaps) and 0 < gaps.min() < max(known):
        return (
            f"an exposure of {max(known):g} s is longer than the {gaps.min():g} s between two frames; "
            "correct the times of the recording or the setting exposure_time"
        )
    return None


RollingShutter = Literal["auto", "on", "off"]

# Neighboring poses further apart than this [s] say nothing about the motion in between: a hand shakes at up
# to 12 Hz, most below 3 Hz.
LONGEST_GAP = 0.15

# The image moves less than this [px] while the rows are read: not worth the two percent that a step costs.
LEAST_SKEW = 0.1


@dataclass(frozen=True)
class ShutterPlan:
    """Whether the training draws every splat from the pose at which its row was read, and why.

    Attributes:
        rolling: whether it does.
        because: the reason, in words.
        readout_time: from the first to the last row [s].
        skew_px: how far the object's image moves meanwhile [px], median over the frames whose motion is
            known; None: unknown.
        blur: what moves while the shutter is open; a result of its own in `Training`.
    """

    rolling: bool
    because: str
    readout_time: float = 0.0
    skew_px: float | None = None
    blur: Annotated[BlurPlan, NOT_STORED] = field(default=NO_BLUR, compare=False)

    def __str__(self) -> str:
        return f"{'drawn' if self.rolling else 'not drawn'}: {self.because}"

    def rows_of(self, frame: Frame) -> RowMotion | None:
        """Return how the camera of a frame moves while its rows are read; None: it is not drawn."""
        motion = frame.exposure.camera_motion
        if not self.rolling or motion is None:
            return None
        turn, shift = np.array(motion.angular_velocity), np.array(motion.velocity)
        return RowMotion(self.readout_time * turn, self.readout_time * shift)


NO_SHUTTER = ShutterPlan(rolling=False, because="all rows at once")


def plan_shutter(
    frames: Sequence[Frame], points: np.ndarray, readout_time: float, setting: RollingShutter
) -> ShutterPlan:
    """Decide by how far the image of the points moves while the rows are read.

    Args:
        frames: of the recording, with their motions, see `with_motions`.
        points: on the object, in the world, shape (n, 3).
        readout_time: from the first row to the last [s]; 0: all rows at once.
        setting: auto decides; on and off do not.

    Raises:
        DigsError: "on", and the recording does not tell what it takes, or contradicts itself.
    """
    if setting == "off":
        return ShutterPlan(False, "--rolling-shutter off", readout_time)
    obstacle = _rolling_obstacle(frames, readout_time)
    if obstacle is not None:
        if setting == "on":
            raise DigsError(f"--rolling-shutter on: {obstacle}")
        if readout_time > 0:
            logger.warning("the rolling shutter is not corrected: %s", obstacle)
        return ShutterPlan(False, obstacle, readout_time)
    skew = _moved_px(frames, points, readout_time)
    known = f"the image moves {skew:.2f} px while the rows are read"
    if setting == "on":
        return ShutterPlan(True, f"--rolling-shutter on; {known}", readout_time, skew)
    return ShutterPlan(skew >= LEAST_SKEW, known, readout_time, skew)


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


def _rolling_obstacle(frames: Sequence[Frame], readout_time: float) -> str | None:
    """Return why a rolling shutter cannot be drawn; None: it can."""
    if readout_time == 0:
        return "the recording tells no read-out time, or 0; --readout-time gives it"
    if all(frame.exposure.camera_motion is None for frame in frames):
        return (
            f"{counted(len(frames), 'frame')} tell no camera_motion, and their poses are more than "
            f"{LONGEST_GAP:g} s apart"
        )
    gaps = np.diff(sorted(frame.time for frame in frames))
    if len(gaps) and 0 < gaps.min() < readout_time:
        return (
            f"a read-out of {readout_time:g} s is longer than the {gaps.min():g} s between two frames; "
            "correct the times of the recording or --readout-time"
        )
    return None


def _moved_px(frames: Sequence[Frame], points: np.ndarray, seconds: float) -> float:
    """Return how far the image of points moves in this time [px], median over points and frames."""
    some = some_of(points)
    moves = [image_speed(frame, some) for frame in frames]
    return seconds * float(np.median(np.concatenate(moves)))
