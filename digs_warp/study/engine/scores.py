"""How good a result is on views that no case has seen.

The yardstick is a recording by a perfect camera on another walk: results are compared on it, whatever they
were made from.
"""

from collections.abc import Sequence
from importlib.util import find_spec
from statistics import fmean
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.measure.metrics import psnr
from digs_warp.study.engine.placement import seen_in_place

if TYPE_CHECKING:
    from digs_warp.train.evaluate import Rendering, TestView

# Settings of the yardstick; the scene is that of the case.
YARDSTICK: dict[str, Any] = {
    **{"frames": 8, "width": 640, "height": 360, "tier": "truth"},
    **{"samples_per_pixel": 4, "seed": 20260521},
}

# The same views from other distances: the names of sizes in records, and what differs. The object is as large
# in the image as from twice, three quarters of and half the distance, and all pixels are true ones.
OTHER_SIZES: dict[str, dict[str, Any]] = {
    "half": {"width": 320, "height": 180, "samples_per_pixel": 16},
    "four_thirds": {"width": 854, "height": 480},
    "double": {"width": 1280, "height": 720},
}


def score_on_yardstick(gaussians: Gaussians, frames: Sequence[Frame]) -> dict[str, float | None]:
    """Compare a result with the yardstick's frames.

    Returns:
        ``psnr_object``, ``ssim_object`` [dB, 1], and ``psnr_frame``, ``ssim_frame`` of the whole image;
        ``flip`` where flip-evaluator is installed;
        ``depth_mae`` [m] and ``depth_seen`` (see `depth_error`).
    """
    from digs_warp.measure.scores import mean_score
    from digs_warp.splat.device import DeviceGaussians
    from digs_warp.train.evaluate import load_test_views, render_views, score_view

    views = load_test_views(frames)
    renderings = render_views(DeviceGaussians.from_numpy(gaussians), views)
    score = mean_score([*map(score_view, renderings, views)]).to_json()
    if find_spec("flip_evaluator"):
        from digs_warp.measure.flip import flip

        pairs = zip((rendering.image for rendering in renderings), views, strict=True)
        score["flip"] = fmean(flip(image, view.target_for(image)) for image, view in pairs)
    return score | depth_error(gaussians, frames)


def psnr_in_place(gaussians: Gaussians, frames: Sequence[Frame], to_truth: np.ndarray) -> float:
    """Return the PSNR on the object [dB] after one gain and one rigid motion of the whole result.

    Args:
        gaussians: the result.
        frames: the yardstick's.
        to_truth: see `placement.motion_to_truth`.
    """
    from digs_warp.splat.device import DeviceGaussians
    from digs_warp.train.evaluate import load_test_views, render_views

    views = load_test_views(seen_in_place(frames, to_truth))
    return psnr_with_one_gain(render_views(DeviceGaussians.from_numpy(gaussians), views), views)


def psnr_with_one_gain(renderings: "Sequence[Rendering]", views: "Sequence[TestView]") -> float:
    """Return the mean PSNR on the object [dB] after one gain of all renderings, the one that fits best.

    A gain for each view would hide that views were trained in different exposures.
    """
    from digs_warp.train.evaluate import photographed_gain, with_gain

    gain = photographed_gain(renderings, views)
    return fmean(
        psnr(with_gain(rendering, gain), view.target, view.object_pixels)
        for rendering, view in zip(renderings, views, strict=True)
    )


def depth_error(gaussians: Gaussians, frames: Sequence[Frame]) -> dict[str, float | None]:
    """Compare the depth of the surface with the true depth, inside the object's mask.

    Returns:
        ``depth_mae``: mean absolute error [m] over the object's pixels that the Gaussians cover by half;
        None without any. ``depth_seen``: the share of the object's pixels that they cover by half.
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
