"""A filter that stands for the neural depth modes of the ZED family: smooth, dense, with blurred steps.

It is no neural network. It does what their depth maps show: values at half the image size, smooth where the
left image is, carried into holes, and enlarged linearly, which leaves points in mid-air at the steps and
loses detail. The smoothing is weighted least squares by fast global smoothing (Min et al. 2014), which
OpenCV's contributed modules use on disparity, too:

    minimize  sum_p (u_p - f_p)^2 + lambda sum_pq exp(-|I_p - I_q| / sigma) (u_p - u_q)^2

solved for f = confidence x disparity and for f = confidence, along rows and columns in turn; their ratio is
the disparity.
"""

# Warp's stubs do not type device code.
# pyright: reportOperatorIssue=false

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.warp_start import start_warp
from digs_warp.sim.sensor.filters import doubled_linearly, halves, transposed
from digs_warp.sim.sensor.post_filters.spatial import GROUP, run_along_columns

start_warp()
wp.set_module_options(vector_module_options())

_GROUP = wp.constant(GROUP)

# The tridiagonal system of each column, solved from above and back (Thomas).
_SOLVE = r"""
const int end = begin + count < width ? begin + count : width;
for (int row = 0; row < height; ++row) {
    const int at = row * width, above = row > 0 ? at - width : at;
    for (int x = begin; x < end; ++x) {
        const float up = row > 0 ? weight.data[above + x] : 0.0f;
        const float down = row < height - 1 ? weight.data[at + x] : 0.0f;
        const float before = row > 0 ? ratio.data[above + x] : 0.0f;
        const float scale = 1.0f / (1.0f + strength * (up * (1.0f - before) + down));
        ratio.data[at + x] = strength * down * scale;
        value.data[at + x] = (value.data[at + x] + strength * up * value.data[above + x]) * scale;
        support.data[at + x] = (support.data[at + x] + strength * up * support.data[above + x]) * scale;
    }
}
for (int row = height - 2; row >= 0; --row) {
    const int at = row * width, below = at + width;
    for (int x = begin; x < end; ++x) {
        value.data[at + x] += ratio.data[at + x] * value.data[below + x];
        support.data[at + x] += ratio.data[at + x] * support.data[below + x];
    }
}
"""


@dataclass(frozen=True)
class Smoothing:
    """How the filter smooths [tuned: 1 to 1.6 flying pixels per pixel of outline, as at half size].

    Attributes:
        strength: lambda, in pixels of half size, squared.
        contrast: difference of gray values at which the coupling has fallen to 1/e [DN].
        step: the same, of disparity [px].
        least_support: holes that less of the surrounding confidence reaches stay, 0 to 1.
    """

    strength: float = 10.0
    contrast: float = 6.0
    step: float = 1.0
    least_support: float = 0.03


# Times that rows and columns are smoothed, more weakly each time.
ITERATIONS = 3


@wp.func_native(_SOLVE)
def solve_columns(
    value: wp.array[float],
    support: wp.array[float],
    weight: wp.array[float],
    ratio: wp.array[float],
    begin: int,
    count: int,
    width: int,
    height: int,
    strength: float,
):
    """Solve the systems of a group of columns; ``weight`` couples each row with the next."""
    ...


@wp.kernel
def solve_kernel(
    first: int,
    value: wp.array[float],
    support: wp.array[float],
    weight: wp.array[float],
    ratio: wp.array[float],
    width: int,
    height: int,
    strength: float,
):
    """Smooth one group of columns in place."""
    begin = (first + wp.tid()) * _GROUP
    solve_columns(value, support, weight, ratio, begin, _GROUP, width, height, strength)


def smooth_densely(
    disparity: np.ndarray,
    confidence: np.ndarray,
    gray: np.ndarray,
    smoothing: Smoothing = Smoothing(),
) -> tuple[np.ndarray, np.ndarray]:
    """Return disparity and confidence after the filter, each (height, width), float32.

    The confidence is the mean of that of the matches round a pixel, in which holes count as 0. Pixels that no
    confidence reaches keep what they have.

    Args:
        disparity: [px], (height, width), float32, NaN where there is none.
        confidence: of each match, 0 to 1, float32.
        gray: left image, (height, width), uint8.
        smoothing: how strongly.
    """
    known = ~np.isnan(disparity)
    trust = np.where(known, confidence, np.float32(0))
    support = halves(trust)
    value = halves(np.where(known, disparity, np.float32(0)) * trust)
    value, support = _smoothed(value, support, halves(gray), smoothing)
    found = support > smoothing.least_support
    reached = doubled_linearly(found.astype(np.float32), disparity.shape)
    ratio = np.where(found, value / np.maximum(support, smoothing.least_support), 0)
    smooth = doubled_linearly(ratio.astype(np.float32), disparity.shape)
    is_reached = reached > 0.5
    smooth = np.where(is_reached, smooth / np.maximum(reached, np.float32(0.5)), disparity)
    spread = np.clip(doubled_linearly(support, disparity.shape), 0, 1)
    return smooth, np.where(is_reached, spread, trust)


def _smoothed(
    value: np.ndarray, support: np.ndarray, gray: np.ndarray, smoothing: Smoothing
) -> tuple[np.ndarray, np.ndarray]:
    """Return both after all iterations; see the minimum above."""
    with np.errstate(invalid="ignore", divide="ignore"):
        matched = value / support  # NaN in holes
    down = _coupling(gray, matched, smoothing)
    across = _coupling(transposed(gray), transposed(matched), smoothing)
    value, support = transposed(value), transposed(support)
    for iteration in range(1, ITERATIONS + 1):
        share = 1.5 * 4.0 ** (ITERATIONS - iteration) / (4.0**ITERATIONS - 1)
        for weight in (across, down):
            images = [value, support, weight, np.empty_like(weight)]
            run_along_columns(solve_kernel, images, [share * smoothing.strength])
            if weight is across or iteration < ITERATIONS:
                value, support = transposed(value), transposed(support)
    return value, support


def _coupling(gray: np.ndarray, matched: np.ndarray, smoothing: Smoothing) -> np.ndarray:
    """Return how strongly each pixel is coupled with the one below, 0 to 1, float32; same shape."""
    change = _change(gray) / np.float32(smoothing.contrast)
    change += np.nan_to_num(_change(matched)) / np.float32(smoothing.step)
    return np.exp(-change)


def _change(values: np.ndarray) -> np.ndarray:
    return np.abs(np.diff(values, axis=0, append=values[-1:]))
