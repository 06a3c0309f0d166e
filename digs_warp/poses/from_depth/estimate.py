"""Poses of a recording from nothing but its color and depth, for scenes with too little texture to match."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.device.libraries import import_open3d
from digs_warp.device.threads import over_items
from digs_warp.geometry.reproject import unproject_pixels
from digs_warp.geometry.rigid import invert_rigid, transform_points
from digs_warp.poses import thresholds
from digs_warp.poses.agreement import got_worse
from digs_warp.poses.from_depth.odometry_chain import (
    along,
    edge_residuals,
    holds,
    loop_edges,
    measured_chain,
    optimized_poses,
)
from digs_warp.poses.from_depth.pair_motion import Edge, FrameFeatures
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
    tracking = _quality(poses, rough, loops)
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


def _quality(poses: np.ndarray, rough: np.ndarray, loops: Sequence[Edge]) -> Tracking:
    drift, residual = (edge_residuals(each, loops) for each in (rough, poses))
    return Tracking(
        frames=len(poses),
        loops=len(loops),
        longest_loop=max((edge.target - edge.source for edge in loops), default=0),
        loop_mm=drift[0],
        loop_deg=drift[1],
        residual_mm=residual[0],
        residual_deg=residual[1],
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
