"""Whether the poses of a recording need to be refined, and the frames with their refined poses."""

from collections.abc import Sequence

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame, posed_at
from digs_warp.data.layers import Layer
from digs_warp.device.threads import over_items
from digs_warp.geometry.rigid import turn_degrees
from digs_warp.poses import thresholds
from digs_warp.poses.agreement import (
    correlation,
    disagreement,
    got_worse,
    measured_pairs,
    medians_of_frames,
    overlapping_pairs,
    reduced,
)
from digs_warp.poses.outcome import PoseRefinement
from digs_warp.poses.refine.bundle_adjustment import adjusted_where_better, in_likely_scale
from digs_warp.poses.refine.photometric_alignment import align
from digs_warp.poses.views import Picture, load_pictures, view_of
from digs_warp.words import counted, first_few

# Standard deviations of normal errors in their median absolute one.
SIGMAS = 1.4826


def refine(
    frames: Sequence[Frame], readout_time: float, needed: bool, estimated: bool = False
) -> tuple[list[Frame], PoseRefinement]:
    """Return the frames with poses that fit their photographs and depth, if those fit much better.

    A single frame that the others contradict even after the alignment is left out.

    Held-out frames belong to them as well: with poses that are off, their score would measure the poses. A
    frame's pose follows from what it has in common with its neighbors, as in structure from motion.

    Args:
        frames: all of them, in order of time.
        readout_time: from the first row to the last [s]; 0: all rows at once.
        needed: whether it was asked for; else poses stay as they are unless the frames agree much better.
        estimated: whether the poses are never exact; poses and distances found together are then taken
            wherever color and depth do not object.

    Raises:
        DigsError: it was asked for, and no two frames with depth show the same.
    """
    if not any(frame.has(Layer.DEPTH) for frame in frames):
        return _left(frames, "no frame has depth", needed)
    given = np.stack([frame.camera.world_from_cam for frame in frames])
    pictures = load_pictures(frames, readout_time)
    found, small, left_out = align(pictures, given), reduced(pictures), ""
    lost = contradicted(small, given)
    if lost and found is not None:
        lost = sorted({*lost} & {*contradicted(small, found.poses)})
    if lost:  # they have pulled at the others
        left_out = f"; left out: {first_few([frames[each].name for each in lost])}"
        kept = [number for number in range(len(frames)) if number not in lost]
        frames, given = [frames[number] for number in kept], given[kept]
        pictures, small = ([of[number] for number in kept] for of in (pictures, small))
        found = align(pictures, given)
    if found is None:
        return _left(frames, f"no two frames with depth show the same surface{left_out}", needed)
    gain = 1 - found.error_after / max(found.error_before, 1e-12)
    little = gain < thresholds.MIN_ALIGNMENT_GAIN and not needed
    because = f"with refined poses the frames would differ {_less(gain)}{left_out}"
    if little and not estimated:
        return _left(frames, because, needed)
    near = in_likely_scale(found.poses, given)
    moved = adjusted_where_better(pictures, small, found.pairs, near, given)
    if little and moved is near:  # then depth alone says so, and it does not say enough
        return _left(frames, because, needed)
    worse = got_worse(
        small, given, moved, found.pairs, thresholds.MIN_DISAGREEMENT_RATIO if little else 1.0
    )
    poses = np.where(worse[:, None, None], given, moved)
    motion = _motion(given, poses)
    if motion[1] > thresholds.MAX_REFINED_TURN_DEG:
        because = f"the frames do not hold together: turned by {motion[1]:.1f}°{left_out}"
        return _left(frames, because, needed)
    because = f"the frames differ {_less(gain)}{left_out}"
    if worse.any():
        because += f"; {counted(int(worse.sum()), 'frame')} would agree less and kept the pose"
    refinement = PoseRefinement(True, because, *motion, adjusted=moved is not near)
    return posed_at(frames, poses), refinement


def contradicted(pictures: Sequence[Picture], poses: np.ndarray) -> list[int]:
    """Return the numbers of frames that agree far less with what they see in common than all others do.

    None where most are few or many: then nothing tells which are right.

    Args:
        pictures: of n frames, `reduced`; some may have no depth.
        poses: ``world_from_cam``, (n, 4, 4).
    """
    pairs, count = overlapping_pairs(pictures, poses), len(poses)
    apart = measured_pairs(disagreement, pictures, poses, pairs)
    apart = medians_of_frames(pairs, count, apart)
    known = np.count_nonzero(np.isfinite(apart))
    if known < thresholds.MIN_COMPARED_FRAMES:
        return []
    usual = np.nanmedian(apart)
    spread = SIGMAS * np.nanmedian(np.abs(apart - usual))
    more = max(thresholds.MIN_OUTLIER_DISAGREEMENT, thresholds.MIN_OUTLIER_DEVIATIONS * spread)
    found = np.flatnonzero(apart > min(usual + more, thresholds.MAX_STEP_DISAGREEMENT))
    if not 0 < len(found) <= thresholds.MAX_OUTLIER_SHARE * known:
        return []
    # Another exposure looks like a contradiction, but details match.
    alike = measured_pairs(correlation, over_items(pictures, view_of), poses, pairs)
    alike = medians_of_frames(pairs, count, alike)
    return found[alike[found] < thresholds.MIN_ALIKE * np.nanmedian(alike)].tolist()


def _left(
    frames: Sequence[Frame], because: str, needed: bool
) -> tuple[list[Frame], PoseRefinement]:
    if needed:
        raise DigsError(
            f"--refine-poses on: {because}; record overlapping frames with depth, or use --poses sfm"
        )
    return list(frames), PoseRefinement(False, because)


def _less(gain: float) -> str:
    return f"{gain:.0%} less" if gain >= 0 else f"{-gain:.0%} more"


def _motion(before: np.ndarray, after: np.ndarray) -> tuple[float, float]:
    """Return the root mean squares of the motion [mm] and the turn [degree]."""
    moved = np.linalg.norm(after[:, :3, 3] - before[:, :3, 3], axis=1)
    turned = turn_degrees(after[:, :3, :3], before[:, :3, :3])
    rms = [round(float(np.sqrt(np.mean(each**2))), 4) for each in (1000 * moved, turned)]
    return rms[0], rms[1]
