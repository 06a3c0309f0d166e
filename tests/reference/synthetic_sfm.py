"""A structure-from-motion model made from the truth of a simulated capture, without feature matching.

Studies and tests choose its scale, feature noise and share of mismatches. Points are where pixels of the
frames see the true surface, background included. A view observes a point if its true depth confirms it.
"""

from collections.abc import Sequence

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.sfm_model import Observations, SfmModel

# A view sees a point when its true depth there agrees to this share.
VISIBLE = 0.01


def sfm_from_truth(
    frames: Sequence[Frame],
    sfm_per_metre: float = 1.0,
    points: int = 3000,
    feature_noise: float = 0.3,
    mismatches: float = 0.02,
    seed: int = 0,
) -> SfmModel:
    """Return a model in [sfm] with the true poses, of frames with true depth.

    ``feature_noise``: standard deviation of the observed pixels, per axis [px]; ``mismatches``: share of
    observations at a random pixel of the image.
    """
    rng = np.random.default_rng(seed)
    depths = [frame.load_depth_true() for frame in frames]
    shares = np.array_split(np.arange(points), len(frames))
    chosen = [
        _surface_points(frame, depth, len(share), rng)
        for frame, depth, share in zip(frames, depths, shares, strict=True)
    ]
    positions = np.concatenate([found for found, _ in chosen])
    colors = np.concatenate([found for _, found in chosen])
    rows = [
        _observe(index, frame, depth, positions, feature_noise, mismatches, rng)
        for index, (frame, depth) in enumerate(zip(frames, depths, strict=True))
    ]
    cameras, seen, px = (np.concatenate(column) for column in zip(*rows, strict=True))
    metric = SfmModel(
        names=tuple(frame.name for frame in frames),
        cameras=tuple(frame.camera for frame in frames),
        points=PointCloud(positions, colors),
        observations=Observations(cameras, seen, px),
        reprojection_errors=np.full(len(positions), feature_noise, dtype=np.float32),
    )
    return metric.in_metres(1.0 / sfm_per_metre)


def _surface_points(
    frame: Frame, depth: np.ndarray, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return world points and colors at random pixels with true depth."""
    rows, columns = np.nonzero(np.isfinite(depth))
    chosen = rng.choice(len(rows), size=min(count, len(rows)), replace=False)
    rows, columns = rows[chosen], columns[chosen]
    px = np.stack([columns + 0.5, rows + 0.5], axis=-1)
    points_world = frame.camera.unproject(px, depth[rows, columns].astype(np.float64))
    return points_world, frame.load_image()[rows, columns] / 255.0


def _observe(
    index: int,
    frame: Frame,
    depth: np.ndarray,
    points_world: np.ndarray,
    feature_noise: float,
    mismatches: float,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return camera numbers, point numbers and pixels of the observations of a view."""
    height, width = depth.shape
    px, z = frame.camera.project(points_world)
    inside = (z > 0) & np.all((px >= 0) & (px < [width, height]), axis=1)
    columns, rows = np.floor(np.where(inside[:, None], px, 0)).astype(np.int64).T
    visible = np.flatnonzero(inside & (np.abs(depth[rows, columns] - z) < VISIBLE * z))
    seen_at = px[visible] + rng.normal(0.0, feature_noise, (len(visible), 2))
    wrong = rng.random(len(visible)) < mismatches
    seen_at[wrong] = rng.uniform((0, 0), (width, height), (int(wrong.sum()), 2))
    return np.full(len(visible), index), visible, np.clip(seen_at, 0, (width, height))
