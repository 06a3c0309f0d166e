"""Whether the training draws motion blur, and from how many poses each photograph.

The motions are those that the rolling shutter goes by (`digs_warp.train.shutter.with_motions`). How long the
shutter is open, the recording tells.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.record.results import ELSEWHERE
from digs_warp.splat.blur import Blur
from digs_warp.splat.row_motion import RowMotion
from digs_warp.train.image_motion import image_speed, some_of
from digs_warp.words import counted

logger = logging.getLogger(__name__)

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
    blurs: Annotated[Mapping[str, Blur], ELSEWHERE] = field(
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
    obstacle = _obstacle(frames, times)
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
    motion = frame.exposure.motion
    assert motion is not None  # it has a speed
    turn, shift = np.array(motion.angular_velocity), np.array(motion.velocity)
    return Blur(RowMotion(time * turn, time * shift), time * speed)


def _obstacle(frames: Sequence[Frame], times: Sequence[float | None]) -> str | None:
    """Return why motion blur cannot be drawn; None: it can."""
    known = [time for time in times if time is not None]
    if not any(known):
        if known:
            return "the recording tells an exposure of 0 s, in which nothing blurs"
        return "the recording tells no exposure time; the setting exposure_time gives it"
    if all(frame.exposure.motion is None for frame in frames):
        return f"nothing tells how the cameras of {counted(len(frames), 'frame')} moved"
    gaps = np.diff(sorted(frame.time for frame in frames))
    if len(gaps) and 0 < gaps.min() < max(known):
        return (
            f"an exposure of {max(known):g} s is longer than the {gaps.min():g} s between two frames; "
            "correct the times of the recording or the setting exposure_time"
        )
    return None
