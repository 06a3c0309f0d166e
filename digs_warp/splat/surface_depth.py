"""The depth of the surface that Gaussians show, from the two depths that a view gives.

The expected depth is a mean over all splats that a pixel shows, and so smoother than the median depth, which
jumps from one splat to the next. But where a pixel shows two surfaces, at the edge of the nearer one, their
mean lies on neither. So the depth of the surface is the expected one where the two agree, else the median.
"""

import numpy as np

from digs_warp.splat.config import EXPECTED, MEDIAN, DepthOf

# Expected and median depth further apart than this share of the depth belong to two surfaces: a centimetre
# at a metre, several times the depth of the soft layer that the splats of one surface are.
SAME_SURFACE = 0.01


def surface_place(is_object: bool) -> DepthOf:
    """Return the place of splats that lies on the surface.

    The mask of an object shows where it ends, which draws the centers of its splats inside. Without masks, as
    in a room, nothing does: the splats keep to the surface.
    """
    return "skin" if is_object else "center"


def surface_depth(drawn: np.ndarray) -> np.ndarray:
    """Return the depth of the surface [m]; NaN where the Gaussians cover less than half of a pixel.

    Args:
        drawn: expected and median depth [m], 0 where there is none, shape (..., 2), float32.
    """
    expected, median = drawn[..., EXPECTED], drawn[..., MEDIAN]
    is_one = np.abs(expected - median) <= SAME_SURFACE * median
    return np.where(median > 0, np.where(is_one, expected, median), np.float32(np.nan))
