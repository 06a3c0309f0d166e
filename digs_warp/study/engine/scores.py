"""How good a result is on views that no case has seen.

The yardstick is a recording by a perfect camera on another walk: results are compared on it, whatever they
were made from. Estimated and refined poses leave one rigid motion of everything open. Nothing in the images
shows it, but a result that lies 3 mm beside the truth misses most of its texture in views of a true camera,
however sharp it is. So its quality is also measured after that one motion, as is usual for estimated poses
(Lin et al. 2021, BARF, section 4.2).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from statistics import fmean
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.viewpoints import evenly
from digs_warp.geometry.rigid import invert_rigid, laid_over, transform_points
from digs_warp.measure.metrics import psnr

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


def score_in_true_views(
    gaussians: Gaussians, yardsticks: Mapping[str, Sequence[Frame]], to_truth: np.ndarray
) -> dict[str, float | None]:
    """Return PSNR [dB], SSIM and ``depth_mae`` [m] in true views, where the result lies.

    And ``psnr_object_in_place`` [dB] after one gain and one rigid motion, at other sizes with their name.

    Args:
        gaussians: the result.
        yardsticks: the views by the name of their size; "": that of `YARDSTICK`.
        to_truth: see `motion_to_truth`.
    """
    from digs_warp.measure.scores import mean_score
    from digs_warp.splat.device import DeviceGaussians
    from digs_warp.train.evaluate import load_test_views, render_views, score_view

    drawn = DeviceGaussians.from_numpy(gaussians)
    views = load_test_views(yardsticks[""])
    score = mean_score([*map(score_view, render_views(drawn, views), views)]).to_json()
    for size, frames in yardsticks.items():
        views = load_test_views(seen_in_place(frames, to_truth))
        name = f"psnr_object_in_place{size and '_'}{size}"
        score[name] = psnr_with_one_gain(render_views(drawn, views), views)
    return score | {"depth_mae": depth_error(gaussians, yardsticks[""])}


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


def depth_error(gaussians: Gaussians, frames: Sequence[Frame]) -> float | None:
    """Return the mean absolute error of the surface's depth [m], where it covers the object by half."""
    from digs_warp.surface.depth_views import depth_views
    from digs_warp.train.evaluate import MASK_THRESHOLD

    views = depth_views(gaussians, [f.camera for f in frames], gaussians.means.mean(axis=0))
    errors = []
    for frame, view in zip(frames, views, strict=True):
        depth = frame.load_depth()
        inside = (frame.load_mask() > MASK_THRESHOLD) & np.isfinite(depth)
        errors.append(np.abs(view.depth - depth)[inside].astype(np.float64))
    error = np.concatenate(errors)
    covered = error[np.isfinite(error)]
    return float(covered.mean()) if len(covered) else None


# Of a result's centers, these many tell where it lies.
POINTS = 1000


def motion_to_truth(
    posed: Sequence[Frame], recorded: Sequence[Frame], gaussians: Gaussians
) -> np.ndarray:
    """Return the rigid motion, (4, 4), that takes a result to where its views with true poses have it.

    It fits the mean over the views of where they see the Gaussians' centers.

    Args:
        posed: the frames that the result was made from, with their final poses.
        recorded: the recording, whose poses are true; frames belong together by their names.
        gaussians: the result, at least three in different places.
    """
    true = {frame.name: frame.camera.world_from_cam for frame in recorded}
    chosen = evenly(range(len(gaussians)), POINTS)
    points = gaussians.means[chosen].astype(np.float64)
    moved = [
        transform_points(true[frame.name] @ frame.camera.cam_from_world, points) for frame in posed
    ]
    return laid_over(points, np.mean(moved, axis=0))


def seen_in_place(frames: Sequence[Frame], to_truth: np.ndarray) -> list[Frame]:
    """Return true views as they see a result that was not moved to its place."""
    back = invert_rigid(to_truth)
    return [
        replace(f, camera=replace(f.camera, world_from_cam=back @ f.camera.world_from_cam))
        for f in frames
    ]
