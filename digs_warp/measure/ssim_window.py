"""The window and the constants of structural similarity (Wang et al. 2004), in numbers and for kernels."""

import math

import warp as wp

WINDOW = 11
REACH = WINDOW // 2  # the window reaches this far [px]
SIGMA = 1.5
C1 = 0.01**2  # for values in 0..1
C2 = 0.03**2


def window_weights() -> list[float]:
    """Return the 11 weights of the separable window; they sum to 1."""
    raw = [math.exp(-((i - REACH) ** 2) / (2 * SIGMA**2)) for i in range(WINDOW)]
    return [value / sum(raw) for value in raw]


# The window is symmetric: weights of the taps at distance 5, 4, 3, 2, 1, 0.
_TAPS = zip(window_weights()[: REACH + 1], range(REACH, -1, -1), strict=True)
_WINDOW_SUM = f"""
#pragma clang fp contract(fast)
return {" + ".join(f"{weight:.9g}f * d{distance}" for weight, distance in _TAPS)};
"""


@wp.func_native(_WINDOW_SUM)
def window_sum(d5: float, d4: float, d3: float, d2: float, d1: float, d0: float) -> float:
    """Weighted sum of eleven taps, given as sums of the two at distance 5, 4, 3, 2, 1 and the middle one."""
    ...
