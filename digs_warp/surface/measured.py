"""Rendered depth that is drawn toward measured depth, where both show the same surface."""

import numpy as np

from digs_warp.splat.surface_depth import SAME_SURFACE
from digs_warp.surface.depth_views import DepthView

# How far, where the measured depth is trusted entirely: more than half, because the noise of its pixels
# averages out over the views and the errors of Gaussians do not; not all, because these are smooth.
MOST_SHARE = 0.7


def toward_measured(view: DepthView, measured: np.ndarray, trust: float) -> DepthView:
    """Return a view whose depth lies between the rendered and the measured one.

    Args:
        view: of the Gaussians.
        measured: depth of the same pixels [m], NaN where unknown, (height, width).
        trust: in the measured depth, 0 to 1.
    """
    apart = measured - view.depth
    with np.errstate(invalid="ignore"):
        is_same = np.abs(apart) <= SAME_SURFACE * view.depth
    depth = np.where(is_same, view.depth + trust * MOST_SHARE * apart, view.depth)
    return DepthView(view.camera, view.color, depth.astype(np.float32))
