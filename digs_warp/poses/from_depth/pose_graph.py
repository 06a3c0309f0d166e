"""The pose graph: loop edges between frames that overlap, and the poses that fit all edges best.

Choi et al., "Robust reconstruction of indoor scenes", CVPR 2015; optimized by Open3D.
"""

from collections.abc import Sequence

import numpy as np

from digs_warp.device.libraries import import_open3d
from digs_warp.device.threads import over_items
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.poses import thresholds
from digs_warp.poses.covisibility import overlapping_pairs
from digs_warp.poses.from_depth.odometry_chain import holds, turn_deg
from digs_warp.poses.from_depth.pair_motion import Edge, FrameFeatures, edge_between

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
