"""How the cameras of a recording moved while their rows were read, and whether the training draws that.

The motion of a frame is what the recording tells (a gyroscope, a simulation), else what the poses just before
and after it say; those are of use only in a video, for a hand shakes several times a second.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.camera_motion import CameraMotion
from digs_warp.data.frame import Frame
from digs_warp.record.results import ELSEWHERE
from digs_warp.splat.row_motion import RowMotion
from digs_warp.train.blur_plan import NO_BLUR, BlurPlan
from digs_warp.train.image_motion import image_speed, some_of
from digs_warp.words import counted

logger = logging.getLogger(__name__)

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
    blur: Annotated[BlurPlan, ELSEWHERE] = field(default=NO_BLUR, compare=False)

    def __str__(self) -> str:
        return f"{'drawn' if self.rolling else 'not drawn'}: {self.because}"

    def rows_of(self, frame: Frame) -> RowMotion | None:
        """Return how the camera of a frame moves while its rows are read; None: it is not drawn."""
        motion = frame.exposure.motion
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
    obstacle = _obstacle(frames, readout_time)
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
        if frame.exposure.motion is None:
            motion = _motion_between(frames[around[0]], frame, frames[around[-1]])
            found[index] = replace(frame, exposure=replace(frame.exposure, motion=motion))
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


def _obstacle(frames: Sequence[Frame], readout_time: float) -> str | None:
    """Return why a rolling shutter cannot be drawn; None: it can."""
    if readout_time == 0:
        return "the recording tells no read-out time, or 0; --readout-time gives it"
    if all(frame.exposure.motion is None for frame in frames):
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
