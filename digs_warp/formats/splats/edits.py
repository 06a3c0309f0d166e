"""Changes to Gaussians: which of them stay, where they are, how many there are."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.frames import OBJECT_THRESHOLD
from digs_warp.formats.splats.rows import turned
from digs_warp.geometry.reproject import reproject
from digs_warp.init.visibility import not_isolated
from digs_warp.usd.frames import Similarity

# Of the views that show a splat, this share has it inside the mask: masks have errors at their rims.
LEAST_INSIDE = 0.9


def placed(gaussians: Gaussians, b_from_a: Similarity) -> Gaussians:
    """Return the Gaussians of frame a in frame b; view-dependent color is turned exactly."""
    there = turned(gaussians, b_from_a.rotation)
    scale, offset = b_from_a.scale, there.world_offset
    if offset is not None:
        offset = (scale * offset[0], scale * offset[1], scale * offset[2])
    return replace(
        there,
        means=scale * there.means.astype(np.float64) + b_from_a.translation,
        log_scales=there.log_scales + np.float32(np.log(scale)),
        world_offset=offset,
    )


def in_box(gaussians: Gaussians, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return which centers lie in a box [m], shape (n,), bool."""
    return np.all((gaussians.means >= low) & (gaussians.means <= high), axis=1)


def in_masks(gaussians: Gaussians, frames: Sequence[Frame]) -> np.ndarray:
    """Return which centers the masks of the frames show, shape (n,), bool."""
    shown, inside = np.zeros(len(gaussians)), np.zeros(len(gaussians))
    for frame in frames:
        if not frame.has(Layer.MASK):
            continue
        camera, mask = frame.camera, frame.load_mask() > OBJECT_THRESHOLD
        seen = reproject(gaussians.means, camera.cam_from_world, camera.intrinsics)
        shown += seen.inside
        inside += seen.inside & mask[seen.rows, seen.columns]
    return (shown > 0) & (inside >= LEAST_INSIDE * shown)


def no_floater(gaussians: Gaussians) -> np.ndarray:
    """Return which centers have others around them, shape (n,), bool; distances are those of neighbors."""
    return not_isolated(gaussians.means)
