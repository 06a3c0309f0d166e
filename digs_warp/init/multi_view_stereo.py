# Warp's stubs do not type device code:
# pyright: reportAttributeAccessIssue=false, reportOperatorIssue=false, reportGeneralTypeIssues=false
# pyright: reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
"""Depth for photographs: each view is matched with its neighbors, from coarse to fine, and views must agree.

Sparse points, or the hull of the masks, tell between which depths a view is swept, and which views see the
same from an angle that tells depth well. At the coarsest size all depths are tried
(`digs_warp.init.plane_sweep`), about a pixel apart in the neighbors; at each finer size a few around what was
found. A depth stays if the windows match and other views found the same surface there.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import warp as wp

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.parallel import launch_parallel
from digs_warp.device.threads import over_items
from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.geometry.reproject import Pinholes, Reprojection, reproject
from digs_warp.init.plane_sweep import (
    NEIGHBORS,
    TILE_HEIGHT,
    TILE_WIDTH,
    SweptPair,
    SweptView,
    sweep_kernel,
)
from digs_warp.init.view_points import nearest_known
from digs_warp.init.visibility import DepthViews, count_views
from digs_warp.record.progress import progress

# Longer side of the coarsest and of the finest images [px].
COARSE, FINEST = 320, 960
# Angles [degrees] between two views of a point: the best one, and how fast smaller and larger ones lose.
BEST_ANGLE, BELOW, ABOVE = 8.0, 3.0, 8.0
# Less tells no depth, and of more, one view sees what the other does not.
LEAST_ANGLE, MOST_ANGLE = 1.0, 40.0
# The swept range reaches over these percentiles of the inverse depths of the points, and further by a share.
FIRST, LAST, BEYOND = 2.0, 98.0, 0.1
# Inverse depths that are tried at the coarsest size, and around what was found at each finer one.
FEWEST_STEPS, MOST_STEPS, FINER_STEPS = 16, 128, 5
# The least score of a match.
LEAST_SCORE = 0.3
# Depths of two views are of one surface up to this share of it; so many other views have to agree.
SAME_SHARE, LEAST_AGREEING = 0.015, 2
# Views that are asked.
ASKED = 8
# Points that tell range and neighbors of a view, at most; fewer tell nothing.
MOST_POINTS, FEWEST_POINTS = 4000, 10


def matched_depth(
    frames: Sequence[Frame], points: np.ndarray, level: int = -1
) -> tuple[list[Frame], float]:
    """Return those with the depth that matching tells, NaN: unknown; and of which share, inside of masks.

    Args:
        frames: with images of any sizes and right poses.
        points: sparse points in the world, or others about where the surface is, (n, 3).
        level: mask values above it belong to the object; -1: everything does.
    """
    picked = np.random.default_rng(0).permutation(len(points))[:MOST_POINTS]
    points, cameras = points[picked].astype(np.float64), [frame.camera for frame in frames]
    rows = [[[getattr(c.intrinsics, name)] for c in cameras] for name in Pinholes._fields]
    poses = np.stack([camera.cam_from_world for camera in cameras])
    sight = reproject(points, poses, Pinholes(*map(np.array, rows)))
    centers = np.stack([camera.center_world for camera in cameras])
    neighbors = [_neighbors(sight.inside, centers, points, i) for i in range(len(frames))]
    masks = [f.load_mask() > level if f.has(Layer.MASK) and level >= 0 else None for f in frames]
    ranges = [_range(sight, i, mask) for i, mask in enumerate(masks)]
    used = [i for i, near in enumerate(neighbors) if len(near) and ranges[i] is not None]
    found = _found(frames, used, neighbors, ranges)
    kept = _agreeing(frames, used, neighbors, found)
    inside, known, measured = 0, 0, []
    for i, depth in zip(used, kept, strict=True):
        k, mask = frames[i].camera.intrinsics, masks[i]
        depth = _resized(depth, k.width, k.height)
        if mask is not None:
            depth[~mask] = np.nan
        inside += depth.size if mask is None else int(mask.sum())
        known += int(np.isfinite(depth).sum())
        measured.append(frames[i].with_layer(Layer.DEPTH, depth))
    return measured, known / max(inside, 1)


def _neighbors(seen: np.ndarray, centers: np.ndarray, points: np.ndarray, index: int) -> np.ndarray:
    """Return the views to match one of n with, the best first; at most `ASKED`.

    Args:
        seen: which of m points each of them shows, (n, m).
        centers: of their cameras, (n, 3).
        points: in the world, (m, 3).
        index: of the view.
    """
    mine = np.flatnonzero(seen[index])
    if len(mine) < FEWEST_POINTS:
        return np.zeros(0, int)
    mine = mine[:: max(1, len(mine) // 200)]
    rays = points[mine] - centers[:, None]
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    cosines = np.clip(np.einsum("nmk,mk->nm", rays, rays[index]), -1.0, 1.0)
    angles = np.degrees(np.arccos(cosines))
    width = np.where(angles < BEST_ANGLE, BELOW, ABOVE)
    weights = np.exp(-0.5 * ((angles - BEST_ANGLE) / width) ** 2)
    weights[~seen[:, mine] | (angles < LEAST_ANGLE) | (angles > MOST_ANGLE)] = 0.0
    scores = weights.sum(axis=1)
    scores[index] = 0.0
    order = np.argsort(-scores, kind="stable")[:ASKED]
    return order[scores[order] > 0]


def _range(sight: Reprojection, index: int, mask: np.ndarray | None) -> tuple[float, float] | None:
    """Return the first and the last inverse depth of a view; None: it sees too few points."""
    seen = np.flatnonzero(sight.inside[index])
    if mask is not None:
        masked = seen[mask[sight.rows[index, seen], sight.columns[index, seen]]]
        seen = masked if len(masked) >= FEWEST_POINTS else seen
    if len(seen) < FEWEST_POINTS:
        return None
    far, near = np.percentile(1.0 / sight.depth[index, seen], [FIRST, LAST])
    more = max(BEYOND * (near - far), 0.02 * near)
    return max(far - more, 0.2 * far), near + more


class _Level(NamedTuple):
    """The images of one size: gray, and how many pixels of them are one of the photograph."""

    grays: list[np.ndarray]
    scales: list[float]


def _levels(frames: Sequence[Frame]) -> list[_Level]:
    """Return all photographs in sizes that double, the coarsest first."""
    import cv2

    def gray(frame: Frame) -> np.ndarray:
        found, unknown = cv2.cvtColor(frame.load_image(), cv2.COLOR_RGB2GRAY), frame.load_unknown()
        if unknown is None:  # else windows would match its rim
            return found
        return nearest_known(np.where(unknown, np.nan, found)).astype(np.uint8)

    finest = [_reduced(image, FINEST) for image in over_items(frames, gray)]
    longest = max(max(image.shape) for image in finest)
    levels = []
    while True:
        size = min(longest, COARSE * 2 ** len(levels))
        grays = [_reduced(image, size) for image in finest]
        widths = [frame.camera.intrinsics.width for frame in frames]
        scales = [g.shape[1] / w for g, w in zip(grays, widths, strict=True)]
        levels.append(_Level(grays, scales))
        if size == longest:
            return levels


def _reduced(image: np.ndarray, longest: int) -> np.ndarray:
    import cv2

    height, width = image.shape
    share = longest / max(height, width)
    if share >= 1.0:
        return image
    size = (max(2, round(width * share)), max(2, round(height * share)))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def _resized(values: np.ndarray, width: int, height: int) -> np.ndarray:
    import cv2

    return cv2.resize(values, (width, height), interpolation=cv2.INTER_NEAREST)


def _found(
    frames: Sequence[Frame],
    used: Sequence[int],
    neighbors: Sequence[np.ndarray],
    ranges: Sequence[tuple[float, float] | None],
) -> dict[int, np.ndarray]:
    """Return planar depth of the views in use at the finest size, NaN where nothing matches."""
    levels = _levels(frames)
    steps = {i: _steps(frames, i, neighbors[i], ranges[i], levels[0].scales) for i in used}
    inverse: dict[int, np.ndarray] = {}
    scores: dict[int, np.ndarray] = {}
    with progress(len(levels) * len(used), "Matching photographs", "view") as bar:
        for number, level in enumerate(levels):
            packed = wp.array(np.concatenate([_packed(g) for g in level.grays]), dtype=int)
            starts = np.cumsum([0, *(gray.size for gray in level.grays)])
            for i in used:
                height, width = level.grays[i].shape
                first, step, count = steps[i]
                if number == 0:
                    begin = np.full((height, width), first, np.float32)
                else:
                    step, count = step / 2**number, FINER_STEPS
                    begin = _resized(inverse[i], width, height) - np.float32(count // 2 * step)
                views, pairs = _geometry(frames, i, neighbors[i], level, starts, step, count)
                inverse[i], scores[i] = _swept(views, pairs, packed, begin)
                bar.update()
    depth = {}
    for i in used:
        known = (scores[i] > LEAST_SCORE) & (inverse[i] > 0)
        depth[i] = np.where(known, 1.0 / np.where(known, inverse[i], 1.0), np.nan)
    return depth


def _taken_to(
    camera: Camera, scale: float, other: Camera, other_scale: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return A (3, 3) and b (3,) of `digs_warp.init.plane_sweep`."""
    motion = other.cam_from_world @ camera.world_from_cam
    # Of images of these sizes; the center of their first pixel is (0, 0).
    back, there = (
        np.diag([s, s, 1.0]) @ c.intrinsics.matrix - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
        for c, s in ((camera, scale), (other, other_scale))
    )
    return there @ motion[:3, :3] @ np.linalg.inv(back), there @ motion[:3, 3]


def _steps(
    frames: Sequence[Frame],
    index: int,
    neighbors: np.ndarray,
    limits: tuple[float, float] | None,
    scales: Sequence[float],
) -> tuple[float, float, int]:
    """Return first inverse depth, step and number of steps at the coarsest size: about a pixel apart."""
    assert limits is not None
    camera = frames[index].camera
    k, scale = camera.intrinsics, scales[index]
    u, v = np.meshgrid(np.array([0.1, 0.5, 0.9]) * k.width, np.array([0.1, 0.5, 0.9]) * k.height)
    pixels = np.stack([scale * u.ravel(), scale * v.ravel(), np.ones(9)])
    farthest = 0.0
    for j in neighbors[:NEIGHBORS]:
        turned, shift = _taken_to(camera, scale, frames[j].camera, scales[j])
        ends = [turned @ pixels + q * shift[:, None] for q in limits]
        if all(np.all(end[2] > 0) for end in ends):
            first, last = (end[:2] / end[2] for end in ends)
            farthest = max(farthest, float(np.median(np.linalg.norm(last - first, axis=0))))
    count = int(np.clip(np.ceil(farthest) + 1, FEWEST_STEPS, MOST_STEPS))
    return limits[0], (limits[1] - limits[0]) / (count - 1), count


def _packed(gray: np.ndarray) -> np.ndarray:
    """Return each pixel with its right, lower and lower right neighbor in one integer, (h * w,), int32."""
    edged = np.pad(gray, ((0, 1), (0, 1)), mode="edge").astype(np.uint32)
    four = edged[:-1, :-1] | edged[:-1, 1:] << 8 | edged[1:, :-1] << 16 | edged[1:, 1:] << 24
    return np.ascontiguousarray(four).view(np.int32).reshape(-1)


def _geometry(
    frames: Sequence[Frame],
    index: int,
    neighbors: np.ndarray,
    level: _Level,
    starts: np.ndarray,
    step: float,
    count: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Return what the kernel reads of a view, which comes first, and of its neighbors."""
    near = neighbors[:NEIGHBORS]
    views = np.zeros(1 + len(near), SweptView.numpy_dtype())
    pairs = np.zeros(len(near), SweptPair.numpy_dtype())
    for row, i in enumerate([index, *near]):
        views[row]["start"] = starts[i]
        views[row]["height"], views[row]["width"] = level.grays[i].shape
    views[0]["step"], views[0]["count"] = step, count
    camera, scale = frames[index].camera, level.scales[index]
    for row, j in enumerate(near):
        turned, shift = _taken_to(camera, scale, frames[j].camera, level.scales[j])
        pairs[row]["view"], pairs[row]["turned"], pairs[row]["shift"] = row + 1, turned, shift
    return views, pairs


def _swept(
    views: np.ndarray, pairs: np.ndarray, packed: wp.array, begin: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the best inverse depths of the first view and their scores, (height, width), float32."""
    height, width = begin.shape
    rows, columns = np.arange(0, height, TILE_HEIGHT), np.arange(0, width, TILE_WIDTH)
    y, x = (each.ravel() for each in np.meshgrid(rows, columns, indexing="ij"))
    inverse, scores = (wp.zeros(begin.size, dtype=float) for _ in range(2))
    given = [
        wp.array(np.stack([x, y], axis=1), dtype=wp.vec2i),
        wp.array(views, dtype=SweptView),
        wp.array(pairs, dtype=SweptPair),
        packed,
        wp.array(begin.reshape(-1), dtype=float),
        *(inverse, scores),
    ]
    launch_parallel(sweep_kernel, len(x), given)
    return inverse.numpy().reshape(begin.shape), scores.numpy().reshape(begin.shape)


def _agreeing(
    frames: Sequence[Frame],
    used: Sequence[int],
    neighbors: Sequence[np.ndarray],
    found: dict[int, np.ndarray],
) -> list[np.ndarray]:
    """Return the depth of the views in use, NaN where too few others agree."""
    kept = []
    for i in used:
        height, width = found[i].shape
        others = DepthViews.of([(frames[j].camera, found[j]) for j in neighbors[i] if j in found])
        camera = frames[i].camera.resized(width, height)
        points = camera.unproject(pixel_centers(width, height), found[i]).reshape(-1, 3)
        agreeing = count_views(points, others, 0.0, SAME_SHARE).confirmed >= LEAST_AGREEING
        enough = agreeing.reshape(height, width)
        kept.append(np.where(enough, found[i], np.nan).astype(np.float32))
    return kept
