"""Poses of a recording from nothing but its color and depth, for scenes with too little texture to match.

Also whether given poses contradict the motions that color and depth show.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.viewpoints import evenly
from digs_warp.device.libraries import import_open3d
from digs_warp.device.threads import over_items
from digs_warp.geometry.reproject import unproject_pixels
from digs_warp.geometry.rigid import invert_rigid, transform_points, turn_degrees
from digs_warp.poses import thresholds
from digs_warp.poses.agreement import disagreements, got_worse, overlapping_pairs
from digs_warp.poses.from_depth.pair_motion import Edge, FrameFeatures, FramePair
from digs_warp.poses.outcome import Tracking, check_depth
from digs_warp.poses.refine.bundle_adjustment import adjusted_where_better
from digs_warp.poses.refine.photometric_alignment import align
from digs_warp.poses.views import Picture, load_pictures
from digs_warp.words import counted, first_few

logger = logging.getLogger(__name__)

# Loops that span at most this many frames hold neighbors in time together; longer ones close circles.
NEAR = 3


@dataclass(frozen=True, eq=False)
class Tracked:
    """What was found.

    Attributes:
        poses: ``world_from_cam``, (n, 4, 4); the world is the first camera.
        middle: of the nearer half of what is seen, in the world [m], (3,).
        tracking: how well it fits together.
    """

    poses: np.ndarray
    middle: np.ndarray
    tracking: Tracking


def track(frames: Sequence[Frame], readout_time: float) -> Tracked:
    """Find the poses of all frames, in metres.

    Odometry from frame to frame; loops where frames overlap that are not neighbors; a pose graph of all
    motions (Choi et al., "Robust reconstruction of indoor scenes", CVPR 2015); in the end `align` over all
    frames at once.

    Args:
        frames: at least two, in order of time, all with depth; their cameras' poses are not used.
        readout_time: from the first row to the last [s]; 0: all rows at once.

    Raises:
        DigsError: frames without depth, or neighbors that do not show the same: the message names them.
        MissingLibraryError: Open3D is not installed.
    """
    import_open3d()
    check_depth(frames)
    pictures = load_pictures(frames, readout_time)
    _check_measured(frames, pictures)
    features = over_items(pictures, FrameFeatures.of)
    small = [each.picture for each in features]
    chain = measured_chain(features)
    _check_whole(frames, chain)
    rough = along(chain)
    near = loop_edges(features, rough, 2, NEAR)
    placed = optimized_poses(rough, chain, near)
    poses, loops = _closed(pictures, features, chain, near, placed)
    # Wrong loops can bend everything: of a turntable by 42 degrees, and .9 when they are measured again.
    if edge_residuals(poses, loops)[1] > thresholds.MAX_SETTLED_RESIDUAL_DEG:
        poses, loops = _closed(pictures, features, chain, near, poses)
    poses = invert_rigid(poses[0]) @ poses
    longest = max((edge.target - edge.source for edge in loops), default=0)
    drift, residual = (edge_residuals(each, loops) for each in (rough, poses))
    tracking = Tracking(len(poses), len(loops), longest, *drift, *residual)
    _check_agreement(tracking)
    return Tracked(poses, _middle(small, poses), tracking)


def _closed(
    pictures: Sequence[Picture],
    features: Sequence[FrameFeatures],
    chain: Sequence[Edge],
    near: Sequence[Edge],
    placed: np.ndarray,
) -> tuple[np.ndarray, list[Edge]]:
    """Return the poses after circles are closed and all frames are aligned, and all loops."""
    loops = [*near, *loop_edges(features, placed, NEAR + 1, len(features))]
    placed = optimized_poses(placed, chain, loops)
    found = align(pictures, placed)
    if found is None:
        return placed, loops
    small = [each.picture for each in features]
    poses = adjusted_where_better(pictures, small, found.pairs, found.poses, placed)
    pairs = np.array([(edge.source, edge.target) for edge in (*chain, *loops)])
    worse = got_worse(small, placed, poses, pairs)
    return np.where(worse[:, None, None], placed, poses), loops


def _check_measured(frames: Sequence[Frame], pictures: Sequence[Picture]) -> None:
    blind = [
        frame.name
        for frame, picture in zip(frames, pictures, strict=True)
        if not np.isfinite(picture.depth).any()
    ]
    if blind:
        raise DigsError(
            f"--poses rgbd: the depth of {counted(len(blind), 'frame')} ({first_few(blind)}) is empty; leave "
            "them out, or use --poses sfm"
        )


def _check_whole(frames: Sequence[Frame], chain: Sequence[Edge]) -> None:
    broken = [edge for edge in chain if not holds(edge)]
    if not broken:
        return
    names = [f"{frames[edge.source].name} and {frames[edge.target].name}" for edge in broken]
    hint = (
        "are these two recordings in one? Reconstruct each alone"
        if len(broken) == 1
        else "are they in order of time, and at most 10 degrees apart? Take more of the film's frames"
    )
    raise DigsError(
        f"--poses rgbd: tracking broke at {len(broken)} of {counted(len(chain), 'step')}, between frames "
        f"{first_few(names)}: color and depth do not show the same; {hint}, or use --poses sfm"
    )


def _check_agreement(tracking: Tracking) -> None:
    if tracking.residual_deg > thresholds.MAX_RESIDUAL_DEG:
        raise DigsError(
            f"--poses rgbd: the motions between frames contradict each other by {tracking.residual_mm:.0f} "
            f"mm and {tracking.residual_deg:.1f}° (median of {tracking.loops} loops, expected at most "
            f"{thresholds.MAX_RESIDUAL_DEG}°): too little tells frames apart; take frames nearer to each "
            "other in time (at most 10 degrees), or use --poses sfm"
        )


def _middle(pictures: Sequence[Picture], poses: np.ndarray) -> np.ndarray:
    """Return the median of the nearer half of what each frame sees, (3,): walls are not what is looked at."""
    points = []
    for picture, pose in zip(pictures, poses, strict=True):
        rows, columns = np.nonzero(picture.depth <= np.nanmedian(picture.depth))
        rows, columns = rows[::10], columns[::10]
        depth = picture.depth[rows, columns].astype(np.float64)
        seen = unproject_pixels(rows, columns, depth, picture.intrinsics)
        points.append(transform_points(pose, seen))
    return np.median(np.concatenate(points), axis=0)


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
