"""Held-out views whose cameras turn until the finished Gaussians fit, as those of the training did.

Where poses are trained, those of held-out photographs are as far off as the others were: without this, their
score would measure the poses (BARF, Lin et al., ICCV 2021, section 4.2, does the same).
"""

from collections.abc import Sequence
from dataclasses import replace

from digs_warp.geometry import mask_box
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.evaluate import TestView, color_aligned, render_views
from digs_warp.train.trained_poses import turned
from digs_warp.train.turns import turn_between

# Sizes of the blocks of pixels that are compared, one after the other.
POOLS = (4, 4, 2, 2, 1, 1)


def turned_views(gaussians: DeviceGaussians, views: Sequence[TestView]) -> list[TestView]:
    """Return the views with turned cameras; the Gaussians stay as they are."""
    found = list(views)
    for pool in POOLS:
        renderings = render_views(gaussians, found)
        for number, (rendering, view) in enumerate(zip(renderings, found, strict=True)):
            image = color_aligned(rendering, view)
            box = mask_box(view.share)
            part = (slice(box[1], box[3]), slice(box[0], box[2]))
            photograph = view.target_for(image)[part]
            turn = turn_between(image[part], photograph, view.camera.intrinsics, box, pool)
            pose = turned(view.camera.world_from_cam, turn)
            found[number] = replace(view, camera=replace(view.camera, world_from_cam=pose))
    return found
