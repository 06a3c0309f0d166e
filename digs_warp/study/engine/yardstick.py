"""Views of a perfect camera on a walk of its own: results are compared on them, whatever they came from."""

from collections.abc import Sequence
from importlib.util import find_spec
from statistics import fmean
from typing import Any

import numpy as np

from digs_warp.data.capture import Frame
from digs_warp.data.gaussians import Gaussians

# The recording; its scene is that of the case.
YARDSTICK: dict[str, Any] = {
    **{"frames": 8, "width": 640, "height": 360, "tier": "truth"},
    **{"samples_per_pixel": 4, "seed": 20260521},
}


def score_on_yardstick(gaussians: Gaussians, frames: Sequence[Frame]) -> dict[str, float | None]:
    """Compare a result with the yardstick's frames.

    Returns:
        ``psnr``, ``ssim`` [dB, 1] of the whole image and, ``_masked``, of the object; ``flip`` where
        flip-evaluator is installed; ``depth_mae`` [m] and ``depth_seen`` (see `depth_error`).
    """
    from digs_warp.splat.device import DeviceGaussians
    from digs_warp.train.evaluate import load_test_views, mean_score, render_views, score_views

    views = load_test_views(frames)
    images = render_views(DeviceGaussians.from_numpy(gaussians), views)
    score = mean_score(score_views(images, views))
    if find_spec("flip_evaluator"):
        from digs_warp.measure.flip import flip

        pairs = zip(images, views, strict=True)
        score["flip"] = fmean(flip(image, view.target) for image, view in pairs)
    return score | depth_error(gaussians, frames)


def depth_error(gaussians: Gaussians, frames: Sequence[Frame]) -> dict[str, float | None]:
    """Compare the median depth of the Gaussians with the true depth, inside the object's mask.

    Returns:
        ``depth_mae``: mean absolute error [m] over the object's pixels that the Gaussians cover by half;
        None without any. ``depth_seen``: the share of the object's pixels that they cover so.
    """
    from digs_warp.surface.depth_views import depth_views
    from digs_warp.train.evaluate import MASK_THRESHOLD

    cameras = [frame.camera for frame in frames]
    errors = []
    pixels = 0
    for frame, view in zip(
        frames, depth_views(gaussians, cameras, gaussians.means.mean(axis=0)), strict=True
    ):
        inside = (frame.load_mask() > MASK_THRESHOLD) & np.isfinite(frame.load_depth())
        error = np.abs(view.depth - frame.load_depth())[inside]
        errors.append(error[np.isfinite(error)])
        pixels += len(error)
    seen = np.concatenate(errors).astype(np.float64)
    return {
        "depth_mae": float(seen.mean()) if len(seen) else None,
        "depth_seen": len(seen) / pixels if pixels else None,
    }
