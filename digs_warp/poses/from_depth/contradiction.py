"""Whether poses that were found without depth contradict the color and depth of neighboring frames."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.viewpoints import evenly
from digs_warp.device.threads import over_items
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.poses import thresholds
from digs_warp.poses.agreement import disagreements
from digs_warp.poses.from_depth.odometry_chain import holds, turn_deg
from digs_warp.poses.from_depth.pair_motion import FrameFeatures, edge_between
from digs_warp.poses.views import load_pictures

# Steps that are measured, evenly over the recording.
MOST = 40


@dataclass(frozen=True)
class Contradiction:
    """What depth says of poses.

    Attributes:
        steps: between neighbors in time that were measured.
        contradicted: where color and depth show another motion.
    """

    steps: int
    contradicted: int

    @property
    def is_contradicted(self) -> bool:
        """Whether the poses are probably wrong somewhere."""
        return self.contradicted > thresholds.MAX_CONTRADICTED_SHARE * self.steps


def contradiction(frames: Sequence[Frame], readout_time: float) -> Contradiction:
    """Measure the motion between neighbors by color and depth, starting from the poses.

    Args:
        frames: with poses in metres, in order of time; those without depth are left out.
        readout_time: from the first row to the last [s]; 0: all rows at once.
    """
    pictures = load_pictures(frames, readout_time)
    seen = [number for number, each in enumerate(pictures) if np.isfinite(each.depth).any()]
    poses = [frames[number].camera.world_from_cam for number in seen]
    steps = evenly(range(len(seen) - 1), MOST)

    def contradicted(number: int) -> bool:
        given = invert_rigid(poses[number + 1]) @ poses[number]
        features = [FrameFeatures.of(pictures[seen[each]]) for each in (number, number + 1)]
        edge = edge_between(features, 0, 1, given)
        first, second = (each.picture for each in features)
        before, after = disagreements(first, second, [given, edge.target_from_source])
        other = (
            turn_deg(invert_rigid(edge.target_from_source) @ given) > thresholds.MIN_OTHER_TURN_DEG
        )
        return bool(other and holds(edge) and before - after > thresholds.MIN_DISAGREEMENT_DROP)

    return Contradiction(len(steps), sum(over_items(steps, contradicted)))
