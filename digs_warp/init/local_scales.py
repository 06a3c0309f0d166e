"""The local scales of eq. 6: the unit of structure from motion according to each view's depth map."""

import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.sfm_model import SfmModel
from digs_warp.device.threads import default_threads
from digs_warp.init.config import InitConfig
from digs_warp.init.edges import smooth_depth
from digs_warp.record.progress import progress

logger = logging.getLogger(__name__)

# The four pixels around an observation show one surface if their depths differ by less than this share.
SAME_SURFACE = 0.01

# With fewer ratios inside the masks, the whole image is used, because an object can lack texture. On six
# recorded objects, the mode of 100 ratios from the object had a scale error of 0.2 %. The whole image, with
# surroundings that are far away and measured less precisely, had up to 0.4 %.
MIN_MASKED = 100


def local_scales(sfm: SfmModel, frames: Sequence[Frame], config: InitConfig) -> np.ndarray:
    """Return the ratios d*/d [sfm / m] of all observations in ``frames``, float64, NaN-free.

    As in the paper, depth is used where it was measured, inside the mask and away from depth jumps. If the
    masks leave fewer than `MIN_MASKED` ratios, the whole image is used.

    Args:
        sfm: the model in [sfm]; only its observations in ``frames`` are used.
        frames: frames with depth; held-out ones must not be among them.
        config: its mask and edge filters.

    Raises:
        DigsError: the model knows none of the frames.
    """
    known = [frame for frame in frames if frame.name in sfm.names]
    if not known:
        raise DigsError(
            f"scale: structure from motion registered none of the {len(frames)} training frames; "
            f"it knows {len(sfm.names)} other names"
        )
    with (
        ThreadPoolExecutor(default_threads()) as pool,
        progress(len(known), "Estimating the scale", "frame") as bar,
    ):
        rows = []
        for row in pool.map(lambda frame: _ratios_of_view(sfm, frame, config), known):
            rows.append(row)
            bar.update()
    ratios, in_mask = np.concatenate(rows, axis=1)
    masked = ratios[in_mask > 0]
    if len(masked) >= MIN_MASKED:
        return masked
    logger.warning(
        "scale: %d observations inside the masks have depth, using all %d of the images",
        len(masked),
        len(ratios),
    )
    return ratios


def _ratios_of_view(sfm: SfmModel, frame: Frame, config: InitConfig) -> np.ndarray:
    """Return the ratios, and whether each one lies in the mask, shape (2, n)."""
    index = sfm.names.index(frame.name)
    camera = sfm.cameras[index]
    seen = sfm.observations.cameras == index
    _, sfm_depths = camera.project(sfm.points.points_world[sfm.observations.points[seen]])
    depth = frame.load_depth()
    if config.edge_filter:
        depth = np.where(smooth_depth(depth), depth, np.float32(np.nan))
    height, width = depth.shape
    shrink = np.array([width / camera.intrinsics.width, height / camera.intrinsics.height])
    px = sfm.observations.px[seen] * shrink
    measured = depth_at(depth, px)
    usable = np.isfinite(measured) & (sfm_depths > 0)
    in_mask = np.ones(len(px), dtype=bool)
    if frame.has(Layer.MASK):
        columns, rows = pixels_at(px[usable], width, height)
        in_mask = frame.load_mask()[rows, columns] > config.mask_level
    else:
        in_mask = in_mask[usable]
    return np.stack([sfm_depths[usable] / measured[usable], in_mask])


def depth_at(depth: np.ndarray, px: np.ndarray) -> np.ndarray:
    """Return the depth [m] at sub-pixel positions (u, v), shape (n,), float64, NaN where there is none.

    Bilinear if the four pixels around a position show one surface (`SAME_SURFACE`); otherwise that of the
    nearest pixel, so that foreground and background are never mixed. Outside the image there is no depth.
    """
    height, width = depth.shape
    px = np.asarray(px, dtype=np.float64)
    inside = np.all((px >= 0) & (px < [width, height]), axis=1)
    columns, rows = pixels_at(px, width, height)
    found = np.where(inside, depth[rows, columns].astype(np.float64), np.nan)
    # Pixel centers lie at +0.5.
    left = np.clip(np.floor(px[:, 0] - 0.5).astype(np.int64), 0, max(width - 2, 0))
    top = np.clip(np.floor(px[:, 1] - 0.5).astype(np.int64), 0, max(height - 2, 0))
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    four = np.stack(
        [depth[top, left], depth[top, right], depth[bottom, left], depth[bottom, right]]
    )
    four = four.astype(np.float64)
    with np.errstate(invalid="ignore"):
        agree = four.max(axis=0) - four.min(axis=0) <= SAME_SURFACE * four.min(axis=0)
    x = np.clip(px[:, 0] - 0.5 - left, 0.0, 1.0)
    y = np.clip(px[:, 1] - 0.5 - top, 0.0, 1.0)
    upper, lower = four[0] * (1 - x) + four[1] * x, four[2] * (1 - x) + four[3] * x
    return np.where(inside & agree, upper * (1 - y) + lower * y, found)


def pixels_at(px: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Return column and row of the pixel that contains each position, clamped to the image."""
    columns = np.clip(np.floor(px[:, 0]).astype(np.int64), 0, width - 1)
    rows = np.clip(np.floor(px[:, 1]).astype(np.int64), 0, height - 1)
    return columns, rows
