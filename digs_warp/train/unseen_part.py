"""What held-out views show that no training view sees: there, Gaussians are a guess."""

from collections.abc import Sequence

import numpy as np

from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.reproject import unproject_pixels
from digs_warp.geometry.rigid import transform_points
from digs_warp.measure.metrics import psnr
from digs_warp.measure.scores import UnseenPart
from digs_warp.measure.thumbnails import SmallDepth, pixels_showing, small_depths
from digs_warp.train.evaluate import COARSE, COARSE_STEP, MeasuredViews, TestView

# A view with depth sees a point unless it measured something nearer by this share.
NEARER = 0.1
# A smaller share of unseen pixels is not worth a word.
LEAST_UNSEEN = 0.005


def unseen_part(
    measured: MeasuredViews, frames: PosedFrames, views: Sequence[TestView]
) -> UnseenPart | None:
    """Return what held-out views show that no training view sees; None: next to nothing.

    Args:
        measured: the held-out views; the Gaussians tell the depth of photographs without depth.
        frames: held-out and training ones; where these have depth, what is hidden counts as unseen.
        views: the held-out ones.
    """
    seen = [*small_depths(frames.training, range(len(frames.training))).values()]
    cameras = [f.camera for f in frames.training if not f.has(Layer.DEPTH)]
    shares, unseen, others = [], [], []
    each = frames.held_out, views, measured.images, measured.depths
    for frame, view, image, rendered in zip(*each, strict=True):
        depth = frame.load_depth()[COARSE] if frame.has(Layer.DEPTH) else rendered
        hidden = _unseen(view.camera, depth, seen, cameras) & view.object_pixels
        values = image.astype(np.float32) / 255.0
        shares.append(np.count_nonzero(hidden) / max(np.count_nonzero(view.object_pixels), 1))
        unseen.append(psnr(values, view.target, hidden))
        others.append(psnr(values, view.target, view.object_pixels & ~hidden))
    if not shares or np.mean(shares) < LEAST_UNSEEN:
        return None
    means = [float(np.mean(dB)) for each in (unseen, others) if (dB := [v for v in each if v == v])]
    return UnseenPart(float(np.mean(shares)), *means)


def _unseen(
    camera: Camera, depth: np.ndarray, seen: Sequence[SmallDepth], cameras: Sequence[Camera]
) -> np.ndarray:
    """Return which pixels show what none of the views sees, (height, width), bool; ``depth`` is coarse."""
    k = camera.intrinsics
    rows, columns = COARSE_STEP * np.indices(depth.shape).reshape(2, -1)
    z = depth.reshape(-1).astype(np.float64)
    points = unproject_pixels(rows, columns, z, camera.intrinsics)
    points = transform_points(camera.world_from_cam, points)
    # The nearest views come first: they see most, and what they see needs no other.
    views = sorted(
        [*((each.camera, each.depth.reshape(-1)) for each in seen), *((c, None) for c in cameras)],
        key=lambda view: float(np.linalg.norm(view[0].center_world - camera.center_world)),
    )
    left = np.flatnonzero(z > 0)
    for other, measured in views:
        pixel, there = pixels_showing(other, points[left])
        hidden = measured is not None and measured[pixel] < (1 - NEARER) * there
        left = left[(pixel < 0) | hidden]
    unseen = np.isin(np.arange(len(z)), left).reshape(depth.shape)
    return unseen[np.arange(k.height)[:, None] // COARSE_STEP, np.arange(k.width) // COARSE_STEP]
