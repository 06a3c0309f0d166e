"""The edge-preserving spatial filter of librealsense, as the device smooths its matches.

Written from Intel's description ("Depth Post-Processing for Intel RealSense Depth Camera D400 Series",
Grunnet-Jepsen and Tong), a simple form of the domain transform (Gastal and Oliveira 2011): an exponential
moving average S along rows and columns, forth and back,

    S(t) = a Y(t) + (1 - a) S(t - 1)   where |Y(t) - S(t - 1)| < delta
    S(t) = Y(t)                        elsewhere: at steps, and next to holes
"""

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.warp_start import start_warp
from digs_warp.sim.sensor.arrays import launch_rows, shared
from digs_warp.sim.sensor.filters import transposed

# Warp's stubs do not type device code.
# pyright: reportOperatorIssue=false


start_warp()
wp.set_module_options(vector_module_options())

# Defaults of librealsense: larger differences are steps, which stay [px]; how often rows and columns are
# averaged.
DELTA = 20 / 32
ITERATIONS = 2

# Columns that a thread filters together: whole vectors, and rows that stay in the first cache.
GROUP = 256
_GROUP = wp.constant(GROUP)

_AVERAGE = r"""
const int end = begin + count < width ? begin + count : width;
for (int step = 1; step < 2 * height - 1; ++step) {
    // Down, then up again.
    const bool is_down = step < height;
    const int row = is_down ? step : 2 * height - 2 - step;
    float* __restrict__ own = values.data + row * width;
    const float* __restrict__ before = is_down ? own - width : own + width;
    for (int x = begin; x < end; ++x) {
        const float change = own[x] - before[x];  // NaN next to a hole: no average
        own[x] = __builtin_fabsf(change) < delta ? before[x] + alpha * change : own[x];
    }
}
"""


@wp.func_native(_AVERAGE)
def average_columns(
    values: wp.array[float],
    begin: int,
    count: int,
    width: int,
    height: int,
    alpha: float,
    delta: float,
):
    """Average a group of columns, from above and then from below."""
    ...


@wp.kernel
def spatial_kernel(
    first: int, values: wp.array[float], width: int, height: int, alpha: float, delta: float
):
    """Average one group of columns in place."""
    begin = (first + wp.tid()) * _GROUP
    average_columns(values, begin, _GROUP, width, height, alpha, delta)


def smooth_spatially(disparity: np.ndarray, alpha: float) -> np.ndarray:
    """Return the disparity after the filter; holes stay.

    Args:
        disparity: [px], (height, width), float32, NaN where there is none.
        alpha: weight of the pixel itself, 0 to 1; 1 changes nothing.
    """
    values = disparity.astype(np.float32)
    for _ in range(ITERATIONS):
        for _ in ("rows", "columns"):
            values = transposed(values)
            height, width = values.shape
            inputs = [shared(values), width, height, alpha, DELTA]
            launch_rows(spatial_kernel, -(-width // GROUP), inputs)
    return values
