"""Poses of a recording from nothing but its color and depth, for scenes with too little texture to match."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.device.libraries import import_open3d
from digs_warp.device.threads import over_items
from digs_warp.geometry.reproject import (
    ROUGH_POSES,
    DepthTolerance,
    compare_depth,
    reproject,
    unproject_pixels,
)
from digs_warp.geometry.rigid import invert_rigid, transform_points
from digs_warp.poses.agreement import got_worse
from digs_warp.poses.align import align
from digs_warp.poses.bundle import adjusted_where_better
from digs_warp.poses.chain import along, bridged, holds, measured_again, measured_chain, turn_deg
from digs_warp.poses.edges import Edge, Sight, edge_between
from digs_warp.poses.information import usual_distance
from digs_warp.poses.pairs import overlapping_pairs
from digs_warp.poses.tracking import Tracking, check_depth, some_of
from digs_warp.poses.views import Picture, load_pictures
from digs_warp.words import counted

logger = logging.getLogger(__name__)

# Poses that differ more from the motions between frames contradict themselves [degree]: those of good
# recordings differ by 0.1 to 0.5, those with wrong motions between frames by 1.2 and more.
CONTRADICTION = 1.0
# From this contradiction on [degree], loops are measured again from the poses that were found.
UNCERTAIN = 0.5
# Loops for each frame, at most.
LOOPS_PER_FRAME = 4
# Loops that span at most this many frames hold neighbors in time together; longer ones close circles.
NEAR = 3
# Motions that contradict the others by more than this are dropped by the pose graph (0 to 1).
PRUNE = 0.25


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
    sights = over_items(pictures, Sight.of)
    small = [sight.picture for sight in sights]
    chain = bridged(sights, measured_chain(sights))
    _check_whole(frames, chain)
    rough = along(chain)
    near = _loops(sights, rough, 2, NEAR)
    placed = _optimized(rough, chain, near)
    chain = measured_again(sights, chain, placed)
    poses, loops = _closed(pictures, sights, chain, near, placed)
    if _apart(poses, loops)[1] > UNCERTAIN:
        poses, loops = _closed(pictures, sights, chain, near, poses)
    poses = invert_rigid(poses[0]) @ poses
    tracking = _told(small, poses, rough, loops)
    _check_agreement(tracking)
    return Tracked(poses, _middle(small, poses), tracking)


def _closed(
    pictures: Sequence[Picture],
    sights: Sequence[Sight],
    chain: Sequence[Edge],
    near: Sequence[Edge],
    placed: np.ndarray,
) -> tuple[np.ndarray, list[Edge]]:
    """Return the poses after circles are closed and all frames are aligned, and all loops."""
    loops = [*near, *_loops(sights, placed, NEAR + 1, len(sights))]
    placed = _optimized(placed, chain, loops)
    found = align(pictures, placed)
    if found is None:
        return placed, loops
    small = [sight.picture for sight in sights]
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
            f"--poses rgbd: the depth of {counted(len(blind), 'frame')} ({some_of(blind)}) is empty; leave "
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
        f"{some_of(names)}: color and depth do not show the same; {hint}, or use --poses sfm"
    )


def _check_agreement(tracking: Tracking) -> None:
    if tracking.residual_deg > CONTRADICTION:
        raise DigsError(
            f"--poses rgbd: the motions between frames contradict each other by {tracking.residual_mm:.0f} "
            f"mm and {tracking.residual_deg:.1f}° (median of {tracking.loops} loops, expected at most "
            f"{CONTRADICTION}°): too little tells frames apart; take frames nearer to each other in time (at "
            "most 10 degrees), or use --poses sfm"
        )


def _loops(sights: Sequence[Sight], poses: np.ndarray, least: int, most: int) -> list[Edge]:
    """Return measured motions between frames that overlap, ``least`` to ``most`` apart in time.

    The farthest in time come first; each frame has at most `LOOPS_PER_FRAME`.
    """
    pictures = [sight.picture for sight in sights]
    pairs = [
        (i, j) for i, j in overlapping_pairs(pictures, poses).tolist() if least <= j - i <= most
    ]
    taken = np.zeros(len(sights), np.intp)
    chosen: list[tuple[int, int]] = []
    for i, j in sorted(pairs, key=lambda pair: (pair[0] - pair[1], pair)):
        if max(taken[i], taken[j]) < LOOPS_PER_FRAME:
            taken[[i, j]] += 1
            chosen.append((i, j))

    def measured(pair: tuple[int, int]) -> Edge:
        likely = invert_rigid(poses[pair[1]]) @ poses[pair[0]]
        return edge_between(sights, *pair, likely, search=False)

    return [edge for edge in over_items(chosen, measured) if holds(edge)]


def _optimized(rough: np.ndarray, chain: Sequence[Edge], loops: Sequence[Edge]) -> np.ndarray:
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
        registration.GlobalOptimizationOption(edge_prune_threshold=PRUNE, reference_node=0),
    )
    return np.stack([node.pose for node in graph.nodes])


def _told(
    pictures: Sequence[Picture], poses: np.ndarray, rough: np.ndarray, loops: Sequence[Edge]
) -> Tracking:
    drift, residual = (_apart(each, loops) for each in (rough, poses))
    return Tracking(
        frames=len(poses),
        loops=len(loops),
        longest_loop=max((edge.target - edge.source for edge in loops), default=0),
        loop_mm=drift[0],
        loop_deg=drift[1],
        residual_mm=residual[0],
        residual_deg=residual[1],
        depth_mm=_depth_apart(pictures, poses),
    )


def _apart(poses: np.ndarray, loops: Sequence[Edge]) -> tuple[float, float]:
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


def _depth_apart(pictures: Sequence[Picture], poses: np.ndarray) -> float:
    """Return the median difference of depth between neighbors [mm]."""
    medians = []
    for number in range(len(pictures) - 1):
        first, second = pictures[number], pictures[number + 1]
        motion = invert_rigid(poses[number + 1]) @ poses[number]
        seen = reproject(_points(first), motion, second.intrinsics)
        measured = second.depth[seen.rows, seen.columns]
        tolerance = DepthTolerance(0.0, ROUGH_POSES.relative * usual_distance(second))
        same = seen.inside & compare_depth(seen.depth, measured, tolerance).agrees
        apart = np.abs(measured - seen.depth)[same]
        medians.append(float(np.median(apart)) if len(apart) else np.nan)
    return round(1000 * float(np.nanmedian(medians)), 4) if np.isfinite(medians).any() else 0.0


def _points(picture: Picture) -> np.ndarray:
    """Return every tenth measured point in the axes of the camera, (k, 3)."""
    rows, columns = np.argwhere(np.isfinite(picture.depth))[::10].T
    depth = picture.depth[rows, columns].astype(np.float64)
    return unproject_pixels(rows, columns, depth, picture.intrinsics)


def _middle(pictures: Sequence[Picture], poses: np.ndarray) -> np.ndarray:
    """Return the median of the nearer half of what each frame sees, (3,): walls are not what is looked at."""
    near = [
        replace(each, depth=np.where(each.depth <= np.nanmedian(each.depth), each.depth, np.nan))
        for each in pictures
    ]
    points = [transform_points(pose, _points(p)) for pose, p in zip(poses, near, strict=True)]
    return np.median(np.concatenate(points), axis=0)
