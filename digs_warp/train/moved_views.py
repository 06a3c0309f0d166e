"""Held-out views whose cameras move until the finished Gaussians fit, as those of the training did.

Where poses are trained, those of held-out photographs are as far off as the others were: without this, their
score would measure the poses (BARF, Lin et al., ICCV 2021, section 4.2, does the same).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from digs_warp.geometry.rigid import mask_box
from digs_warp.poses.in_training import filled_depth, motion_between, moved
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.evaluate import TestView, color_aligned, render_views

# Sizes of the blocks of pixels that are compared, one after the other; over single pixels cameras shift, too.
POOLS = (4, 4, 2, 2, 1, 1, 1)


def moved_views(
    gaussians: DeviceGaussians, views: Sequence[TestView], shifts: bool = True
) -> list[TestView]:
    """Return the views with moved cameras, which only turn without ``shifts``; the Gaussians stay."""
    found = list(views)
    middle = np.median(gaussians.means.numpy(), axis=0)
    for pool in POOLS:
        renderings = render_views(gaussians, found, with_depth=shifts and pool == 1)
        for number, (rendering, view) in enumerate(zip(renderings, found, strict=True)):
            image, pose = color_aligned(rendering, view), view.camera.world_from_cam
            box = mask_box(view.share)
            part = (slice(box[1], box[3]), slice(box[0], box[2]))
            photograph = view.target_for(image)[part]
            depth = None
            if rendering.depth is not None:
                depth = filled_depth(rendering.depth[part], photograph.shape[:2], pose, middle)
            k = view.camera.intrinsics
            motion = motion_between(image[part], photograph, k, box, pool, depth)
            camera = replace(view.camera, world_from_cam=moved(pose, motion))
            found[number] = replace(view, camera=camera)
    return found
