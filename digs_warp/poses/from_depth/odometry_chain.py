"""The motions from each frame to the next, loops between others, and the poses that fit all of them best.

Broken steps are bridged. Loops and poses: Choi et al., "Robust reconstruction of indoor scenes", CVPR 2015;
optimized by Open3D. Also whether given poses contradict the motions.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.viewpoints import evenly
from digs_warp.device.libraries import import_open3d
from digs_warp.device.threads import over_items
from digs_warp.geometry.rigid import invert_rigid, turn_degrees
from digs_warp.poses import thresholds
from digs_warp.poses.agreement import disagreements
from digs_warp.poses.covisibility import overlapping_pairs
from digs_warp.poses.from_depth.pair_motion import Edge, FrameFeatures, FramePair, edge_between
from digs_warp.poses.views import load_pictures

# Frames before and after a step that breaks, from which it is bridged.
BRIDGE = 2


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


def bridged(features: Sequence[FrameFeatures], chain: Sequence[Edge]) -> list[Edge]:
    """Return the chain; where it breaks, the motion between other frames on both sides that holds best.

    A bridge from frame a to frame b over one broken step tells that step: the others between a and b hold.
    """
    edges = list(chain)
    for number, edge in enumerate(chain):
        if holds(edge):
            continue
        first = range(max(0, number - BRIDGE), number + 1)
        last = range(number + 1, min(len(features), number + 2 + BRIDGE))
        for i, j in sorted(
            ((i, j) for i in first for j in last), key=lambda pair: pair[1] - pair[0]
        ):
            before, after = edges[i:number], edges[number + 1 : j]
            if j - i == 1 or not all(holds(each) for each in (*before, *after)):
                continue
            bridge = edge_between(features, i, j, _motion([*before, *after]))
            if bridge.disagreement <= thresholds.MAX_BRIDGE_DISAGREEMENT or _certain(bridge):
                edges[number] = _step(bridge, before, after)
                break
    return edges


def _step(bridge: Edge, before: Sequence[Edge], after: Sequence[Edge]) -> Edge:
    """Return the one step of a bridge that is neither before nor after it."""
    motion = (
        invert_rigid(_motion(after)) @ bridge.target_from_source @ invert_rigid(_motion(before))
    )
    source, target = bridge.source + len(before), bridge.target - len(after)
    return replace(bridge, source=source, target=target, target_from_source=motion)


def _motion(edges: Sequence[Edge]) -> np.ndarray:
    """Return the motion of all edges one after the other, (4, 4)."""
    motion = np.eye(4)
    for edge in edges:
        motion = edge.target_from_source @ motion
    return motion


def along(chain: Sequence[Edge]) -> np.ndarray:
    """Return ``world_from_cam`` of each frame from the motions one after the other, (n, 4, 4)."""
    poses = [np.eye(4)]
    for edge in chain:
        poses.append(poses[-1] @ invert_rigid(edge.target_from_source))
    return np.stack(poses)


def measured_again(
    features: Sequence[FrameFeatures], chain: Sequence[Edge], placed: np.ndarray
) -> list[Edge]:
    """Return the motions between neighbors; what all together contradict is measured from their poses."""

    def again(edge: Edge) -> Edge:
        likely = invert_rigid(placed[edge.target]) @ placed[edge.source]
        if (
            turn_deg(invert_rigid(edge.target_from_source) @ likely)
            <= thresholds.MAX_STEP_RESIDUAL_DEG
        ):
            return edge
        other = edge_between(features, edge.source, edge.target, likely, search=False)
        return min((edge, other), key=lambda each: each.disagreement)

    return over_items(chain, again)


def holds(edge: Edge) -> bool:
    """Return whether the frames show the same under their motion."""
    return edge.disagreement <= thresholds.MAX_STEP_DISAGREEMENT or _certain(edge)


def _certain(edge: Edge) -> bool:
    return (
        edge.matches >= thresholds.MIN_STEP_INLIERS
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
        edge = edge_between(features, 0, 1, given)
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
        return edge_between(features, *pair, likely, search=False)

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
