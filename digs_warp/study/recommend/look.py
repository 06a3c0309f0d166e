"""Looks at a capture before its reconstruction: sizes, first points, colors, speed of this machine."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import fmean

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.evenly import evenly
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.config import InitConfig
from digs_warp.init.depth_points import drawn
from digs_warp.init.random_points import random_points
from digs_warp.init.ray_points import ray_points
from digs_warp.init.recipes import initialize
from digs_warp.init.seed_gaussians import seed_gaussians
from digs_warp.init.seed_start import seed_start
from digs_warp.init.seen_colors import look_up
from digs_warp.init.start import Subject
from digs_warp.init.view_dependence import ViewDependence, view_dependence
from digs_warp.init.voxel_size import MOST_POINTS, pixel_size
from digs_warp.pipeline.config import subject_of
from digs_warp.pipeline.front_end import quick_check
from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.train.config import TrainConfig
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views

# Training frames that are looked at: as many as the study's shortest recordings have.
LOOKED_AT = 14
# Points where there is no depth: as many as the study's usual start has there.
WITHOUT_DEPTH = 50_000
# Training steps that are timed: for this long, but at least this many, after a few that are not.
TIMED_SECONDS, FEWEST_STEPS, WARM_UP_STEPS = 1.0, 3, 2


@dataclass(frozen=True)
class Look:
    """What a capture says about its reconstruction.

    Attributes:
        frames: of the capture, held-out ones included.
        width, height: of its largest image [px].
        subject: what is reconstructed.
        has_depth, has_masks, knows_poses: what the capture brings; masks only where they are used.
        looked_at: training frames that the points below are from.
        points: from their depth, of an object in voxels of ``voxel_pixels`` pixels, of a scene as usual;
            without depth, as many as are usual.
        pixel: width of a pixel at the object [m]; None for a scene, and without depth.
        scatter: median distance of the measured depth from these points, along the ray [m]; None without
            depth.
        color: what the photographs say about view-dependence.
        step_seconds: time of a training step on this machine [s]; None: not measured.
        step_points: from how many of the points.
        check_seconds: time that the check of the capture takes on this machine [s]; 0: not measured.
    """

    frames: int
    width: int
    height: int
    subject: Subject
    has_depth: bool
    has_masks: bool
    knows_poses: bool
    looked_at: int
    points: int
    pixel: float | None = None
    scatter: float | None = None
    color: ViewDependence | None = None
    step_seconds: float | None = None
    step_points: int = 0
    check_seconds: float = 0.0


def look_at(
    capture: Capture, config: ReconstructConfig, voxel_pixels: float, timed: bool = True
) -> Look:
    """Look at a few training frames of a capture, and train on them for a second.

    Args:
        capture: the recording.
        config: what the user wants; says what is held out, and what the subject is.
        voxel_pixels: edge length of the voxels of the points, in pixels at the object.
        timed: whether training steps and the check are timed.

    Raises:
        DigsError: a frame cannot be read, or its depth gives no points.
    """
    subject = subject_of(capture, config.subject, config.segment)
    training, _ = capture.split(config.test_every)
    if subject == "scene":
        training = [frame.without_layer(Layer.MASK) for frame in training]
    sizes = [frame.camera.intrinsics for frame in capture.frames]
    found = Look(
        frames=len(capture),
        width=max(size.width for size in sizes),
        height=max(size.height for size in sizes),
        subject=subject,
        has_depth=capture.has_depth,
        has_masks=subject == "object",
        knows_poses=capture.knows_poses,
        looked_at=min(LOOKED_AT, len(training)),
        points=WITHOUT_DEPTH,
    )
    if not capture.knows_poses:  # nothing fits together yet
        return found
    some = evenly(training, LOOKED_AT)
    if capture.has_depth:
        points, pixel = _points(some, config.init, voxel_pixels, subject)
        found = replace(
            found,
            points=len(points),
            pixel=pixel,
            scatter=scatter(some, points.points_world),
            color=view_dependence(look_up(some, points.points_world)),
        )
    elif subject == "scene":
        points = ray_points(some, WITHOUT_DEPTH)
    else:
        points = random_points([frame.camera for frame in some], WITHOUT_DEPTH)
    if timed:
        if len(points) > MOST_POINTS:  # a step would take too long
            points = points.select(drawn(len(points), MOST_POINTS))
        seconds = _step_seconds(some, points, config.train, subject)
        start = time.perf_counter()
        quick_check(capture, config)
        checking = time.perf_counter() - start
        found = replace(
            found, step_seconds=seconds, step_points=len(points), check_seconds=checking
        )
    return found


def scatter(frames: Sequence[Frame], points_world: np.ndarray) -> float | None:
    """Return the median distance of the measured depth from points, along the viewing ray [m].

    Points that a frame sees at quite another depth, by more than a tenth, are hidden there. None: no frame
    sees any.

    Args:
        frames: with depth maps and metric cameras.
        points_world: on the surface, shape (n, 3).
    """
    apart = []
    for frame in frames:
        if not frame.has(Layer.DEPTH):
            continue
        depth = frame.load_depth()
        px, z = frame.camera.project(points_world)
        with np.errstate(invalid="ignore"):
            inside = (z > 0) & np.all((px >= 0) & (px < depth.shape[::-1]), axis=1)
        columns, rows = px[inside].astype(np.int64).T
        away = np.abs(depth[rows, columns] - z[inside])
        apart.append(away[away < 0.1 * z[inside]])  # False where the depth is NaN
    known = np.concatenate(apart) if apart else np.empty(0)
    return float(np.median(known)) if known.size else None


def _points(
    frames: Sequence[Frame], config: InitConfig, voxel_pixels: float, subject: Subject
) -> tuple[PointCloud, float | None]:
    """Return points from the depth of some frames, and the width of a pixel at the object [m].

    In a scene there is no such width: surfaces are at all distances, and so are the usual voxels.
    """
    some = [frame for frame in frames if frame.has(Layer.DEPTH)]
    pixel = pixel_size(some, config.mask_level) if subject == "object" else None
    settings = replace(
        config,
        strategy="highdepth",
        voxel_size=None if pixel is None else voxel_pixels * pixel,
        voxel_unit="metre",
        target_points=None,
        max_points=None,
    )
    return initialize(some, settings, subject=subject).points, pixel


def _step_seconds(
    frames: Sequence[Frame], points: PointCloud, config: TrainConfig, subject: Subject
) -> float:
    """Return the mean time of a training step [s]: what else the machine does counts, too."""
    views = open_views(frames, replace(config, half_size_until=0.0))
    try:
        start = seed_start(InitConfig(), subject, config.stop.iterations)
        seeds = seed_gaussians(points, config.usual_sh_degree, *start)
        trainer = Trainer(seeds, views, replace(config, half_size_until=0.0))
        # The middle of a run: the color has all its bands.
        trainer.optimizer.step = config.stop.iterations // 2
        for _ in range(WARM_UP_STEPS):
            trainer.step()
        steps: list[float] = []
        while len(steps) < FEWEST_STEPS or sum(steps) < TIMED_SECONDS:
            start = time.perf_counter()
            trainer.step()
            steps.append(time.perf_counter() - start)
        return fmean(steps)
    finally:
        views.close()
