"""The motions from each frame to the next, loops between others, and the poses that fit all of them best.

Loops and poses: Choi et al., "Robust reconstruction of indoor scenes", CVPR 2015;
optimized by Open3D. Also whether given poses contradict the motions.
"""

from collections.abc import Sequence

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.viewpoints import evenly
from digs_warp.device.libraries import import_open3d
from digs_warp.device.threads import over_items
from digs_warp.geometry.rigid import invert_rigid, turn_degrees
from digs_warp.poses import thresholds
from digs_warp.poses.agreement import disagreements
from digs_warp.poses.covisibility import overlapping_pairs
from digs_warp.poses.from_depth.pair_motion import Edge, FrameFeatures, FramePair
from digs_warp.poses.views import load_pictures


def measured_chain(features: Sequence[FrameFeatures]) -> list[Edge]:
    """Return the motion from each frame to the next.

    Where features tell it, all are measured at once; else the step before is likely to go on.
    """

    def measured(number: int) -> FramePair | Edge:
        pair = FramePair.of(features, number, number + 1)
        return pair.edge(np.eye(4)) if pair.is_certain else pair

    edges: list[Edge] = []
    before = np.eye(4)
    for each in over_items(range(len(features) - 1), measured):
        edge = each if isinstance(each, Edge) else each.edge(before)
        edges.append(edge)
        before = edge.target_from_source if holds(edge) else np.eye(4)
    return edges


def along(chain: Sequence[Edge]) -> np.ndarray:
    """Return ``world_from_cam`` of each frame from the motions one after the other, (n, 4, 4)."""
    poses = [np.eye(4)]
    for edge in chain:
        poses.append(poses[-1] @ invert_rigid(edge.target_from_source))
    return np.stack(poses)


def holds(edge: Edge) -> bool:
    """Return whether the frames show the same under their motion."""
    return (
        edge.disagreement <= thresholds.MAX_STEP_DISAGREEMENT
        or edge.matches >= thresholds.MIN_STEP_INLIERS
        or edge.correlation >= thresholds.MIN_STEP_CORRELATION
    )


def turn_deg(motion: np.ndarray) -> float:
    """Return the angle of a motion's turn [degree]."""
    return float(turn_degrees(motion[:3, :3], np.eye(3)))


# Steps that are measured, evenly over the recording.
MOST = 40


def contradicted_steps(frames: Sequence[Frame], readout_time: float) -> tuple[int, int]:
    """Return at how many steps color and depth show another motion than the poses, and of how many.

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
        edge = FramePair.of(features, 0, 1).edge(given)
        first, second = (each.picture for each in features)
        before, after = disagreements(first, second, [given, edge.target_from_source])
        other = (
            turn_deg(invert_rigid(edge.target_from_source) @ given) > thresholds.MIN_OTHER_TURN_DEG
        )
        return bool(other and holds(edge) and before - after > thresholds.MIN_DISAGREEMENT_DROP)

    return sum(over_items(steps, contradicted)), len(steps)


# Loop edges of each frame, at most.
LOOPS_PER_FRAME = 4


def loop_edges(
    features: Sequence[FrameFeatures], poses: np.ndarray, least: int, most: int
) -> list[Edge]:
    """Return measured motions between frames that overlap, ``least`` to ``most`` apart in time.

    The farthest in time come first; each frame has at most `LOOPS_PER_FRAME`.
    """
    pictures = [each.picture for each in features]
    pairs = [
        (i, j) for i, j in overlapping_pairs(pictures, poses).tolist() if least <= j - i <= most
    ]
    taken = np.zeros(len(features), np.intp)
    chosen: list[tuple[int, int]] = []
    for i, j in sorted(pairs, key=lambda pair: (pair[0] - pair[1], pair)):
        if max(taken[i], taken[j]) < LOOPS_PER_FRAME:
            taken[[i, j]] += 1
            chosen.append((i, j))

    def measured(pair: tuple[int, int]) -> Edge:
        likely = invert_rigid(poses[pair[1]]) @ poses[pair[0]]
        return FramePair.of(features, *pair).edge(likely, search=False)

    return [edge for edge in over_items(chosen, measured) if holds(edge)]


def optimized_poses(rough: np.ndarray, chain: Sequence[Edge], loops: Sequence[Edge]) -> np.ndarray:
    """Return the poses that fit all motions best; motions that contradict the others do not count."""
    registration = import_open3d().pipelines.registration
    graph = registration.PoseGraph()
    for pose in rough:
        graph.nodes.append(registration.PoseGraphNode(pose))
    for edge, uncertain in [*((e, False) for e in chain), *((e, True) for e in loops)]:
        motion, known = edge.target_from_source, edge.information
        graph.edges.append(
            registration.PoseGraphEdge(edge.source, edge.target, motion, known, uncertain)
        )
    registration.global_optimization(
        graph,
        registration.GlobalOptimizationLevenbergMarquardt(),
        registration.GlobalOptimizationConvergenceCriteria(),
        registration.GlobalOptimizationOption(
            edge_prune_threshold=thresholds.MIN_EDGE_WEIGHT, reference_node=0
        ),
    )
    return np.stack([node.pose for node in graph.nodes])


def edge_residuals(poses: np.ndarray, loops: Sequence[Edge]) -> tuple[float, float]:
    """Return the median difference of loops from poses [mm, degree]."""
    if not loops:
        return 0.0, 0.0
    motions = [
        invert_rigid(e.target_from_source) @ invert_rigid(poses[e.target]) @ poses[e.source]
        for e in loops
    ]
    lengths = [np.linalg.norm(motion[:3, 3]) for motion in motions]
    turns = [turn_deg(motion) for motion in motions]
    return round(1000 * float(np.median(lengths)), 4), round(float(np.median(turns)), 4)
