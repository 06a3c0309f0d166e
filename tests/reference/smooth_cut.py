"""A smooth alpha cut for the raster kernels: `reference.splat_twin.cut_share` as device code."""

import warp as wp

from digs_warp.splat.tile import AlphaCut

# From min_alpha on: below it the kernels may pass over a splat.
CUT_WIDTH = 1.0 / 255.0
_WIDTH = wp.constant(CUT_WIDTH)


@wp.func
def position_in_cut(raw: float, min_alpha: float) -> float:
    """T: 0 at min_alpha, 1 at the end of the cut."""
    return wp.clamp((raw - min_alpha) / _WIDTH, 0.0, 1.0)


@wp.func
def smooth_alpha(raw: float, min_alpha: float, max_alpha: float) -> float:
    """Alpha times t^2 (3 - 2 t)."""
    t = position_in_cut(raw, min_alpha)
    return wp.min(raw, max_alpha) * t * t * (3.0 - 2.0 * t)


@wp.func
def smooth_slope(raw: float, alpha: float, min_alpha: float, max_alpha: float) -> float:
    """Derivative of alpha in ln raw: alpha + raw^2 6 t (1 - t) / width, and 0 where it is capped."""
    t = position_in_cut(raw, min_alpha)
    return wp.where(raw <= max_alpha, alpha + raw * raw * 6.0 * t * (1.0 - t) / _WIDTH, 0.0)


SMOOTH_CUT = AlphaCut(smooth_alpha, smooth_slope)
