"""How well poses were found and refined. Imports nothing heavy: results and commands read it."""

from collections.abc import Sequence
from dataclasses import dataclass

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.words import counted, first_few


@dataclass(frozen=True)
class Tracking:
    """How well the motions between frames fit together.

    Attributes:
        frames: number of frames that were placed: all of them.
        loops: pairs of frames, not neighbors in time, whose motion was measured and fits.
        longest_loop: how many frames lie between the frames of such a pair, at most.
        loop_mm, loop_deg: median disagreement of these motions with the motions from frame to frame, summed
            up: what the poses drifted before the loops were closed [mm, degree]; 0 without loops.
        residual_mm, residual_deg: the same with the poses in the end: how uncertain these are.
    """

    frames: int
    loops: int
    longest_loop: int
    loop_mm: float
    loop_deg: float
    residual_mm: float
    residual_deg: float

    def __str__(self) -> str:
        placed = f"{self.frames} frames placed by color and depth"
        if not self.loops:
            return f"{placed}; no loop closes, so nothing tells how far the poses drift"
        return (
            f"{placed}; {self.loops} loops over up to {self.longest_loop} frames close after a drift of "
            f"{self.loop_mm:.1f} mm and {self.loop_deg:.2f}°, and differ from the poses by "
            f"{self.residual_mm:.1f} mm and {self.residual_deg:.2f}°"
        )


def check_depth(frames: Sequence[Frame]) -> None:
    """Check that all frames have a depth map.

    Raises:
        DigsError: some have none; the message names them.
    """
    without = [frame.name for frame in frames if not frame.has(Layer.DEPTH)]
    if without:
        raise DigsError(
            f"--poses rgbd: {len(without)} of {counted(len(frames), 'frame')} have no depth "
            f"({first_few(without)}), expected depth in all; leave them out, or use --poses sfm"
        )


@dataclass(frozen=True)
class PoseRefinement:
    """Whether poses were refined, and why.

    Attributes:
        refined: whether they were.
        because: the reason, in words.
        moved_mm: root mean square motion of the cameras [mm]; 0 if they were not refined.
        turned_deg: the same of their rotation [degree].
        in_training: whether the cameras move further while the Gaussians are trained.
        adjusted: whether a bundle adjustment found the centers: the training then only turns the cameras.
    """

    refined: bool
    because: str
    moved_mm: float = 0.0
    turned_deg: float = 0.0
    in_training: bool = False
    adjusted: bool = False

    def __str__(self) -> str:
        if not self.refined:
            return f"not refined: {self.because}"
        moved = f"moved {self.moved_mm:.2f} mm and turned {self.turned_deg:.3f}°"
        return f"refined: {self.because}; {moved} (root mean square)"
