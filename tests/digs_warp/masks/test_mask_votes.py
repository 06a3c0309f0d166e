"""Votes on masks: the kernel against plain NumPy, and the same votes on any number of threads."""

from dataclasses import replace

import numpy as np
import warp as wp

from digs_warp.masks.votes import Views
from digs_warp.measure.thumbnails import SmallDepth
from reference.ball_capture import ball_views
from reference.votes_twin import votes_on


def frames_with_holes(count: int) -> list[SmallDepth]:
    """Views of a ball, the odd ones at half the size, a tenth of the depth unknown, one without any."""
    rng = np.random.default_rng(1)
    frames = []
    for number, (camera, images) in enumerate(ball_views(count)):
        step = 1 + number % 2
        depth = images.depth[::step, ::step].copy()
        depth[rng.random(depth.shape) < 0.1] = np.nan
        height, width = depth.shape
        frames.append(
            SmallDepth(
                number=number,
                camera=camera.resized(width, height),
                depth=depth,
                mask=images.mask[::step, ::step] > 0,
            )
        )
    return [*frames[:-1], replace(frames[-1], depth=np.full_like(frames[-1].depth, np.nan))]


def on_device(points: np.ndarray) -> wp.array:
    return wp.array(points, dtype=wp.vec3d, device="cpu")


def test_views_vote_as_the_twin_says() -> None:
    frames = frames_with_holes(9)
    rng = np.random.default_rng(2)
    own = frames[0].points_at(*np.nonzero(np.isfinite(frames[0].depth)))
    points = np.concatenate([own, rng.uniform(-3, 3, (500, 3))])  # also behind cameras
    voters = [1, 2, 5, 7, 8]
    views = Views.of(frames)
    found = views.votes(on_device(points), voters)
    np.testing.assert_array_equal(found, votes_on(points, [frames[n] for n in voters]))
    assert 0 < found[:, 1].sum() < found[:, 0].sum() < len(voters) * len(points)
    assert views.votes(on_device(points), []).sum() == 0
    assert views.votes(on_device(points[:0]), voters).shape == (0, 2)
