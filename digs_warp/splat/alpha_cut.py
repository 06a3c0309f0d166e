"""Alpha of a splat at a pixel: o exp(-q / 2), capped at max_alpha and not drawn below min_alpha.

The cut is a step, at which an image has no derivative: central differences cannot check a gradient across it.
The raster kernels therefore take their cut as two functions, and a test gives them a smooth one.
"""

from dataclasses import dataclass

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def capped_and_cut(raw: float, min_alpha: float, max_alpha: float) -> float:
    """Alpha for raw = o exp(-q / 2): at most max_alpha, 0 below min_alpha."""
    alpha = wp.min(raw, max_alpha)
    return wp.where(alpha >= min_alpha, alpha, 0.0)


@wp.func
def slope_in_power(raw: float, alpha: float, min_alpha: float, max_alpha: float) -> float:
    """Derivative of alpha in -q / 2: alpha itself, and zero where it is capped or cut."""
    return wp.where(raw <= max_alpha, alpha, 0.0)


@dataclass(frozen=True)
class AlphaCut:
    """Device functions: alpha, and its derivative in the exponent -q / 2.

    Attributes:
        alpha: (raw, min_alpha, max_alpha) -> alpha. It has to be 0 where raw < min_alpha: there a splat may
            have been passed over.
        slope: (raw, alpha, min_alpha, max_alpha) -> d alpha / d(-q / 2).
    """

    alpha: wp.Function
    slope: wp.Function


STEP_CUT = AlphaCut(capped_and_cut, slope_in_power)
