"""Loops over the values of an image that would take NumPy a pass over the memory for each operation.

They do in one pass what NumPy would do in several, operation by operation, to the same bits:
`reference.color_twin`.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

from functools import cache

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import vector_module_options
from digs_warp.sim.sensor.arrays import launch_rows, shared
from digs_warp.sim.sensor.color.protocol import ByChannel
from digs_warp.sim.sensor.noise_field import normal_quantiles

wp.set_module_options(vector_module_options())

# Plain C: LLVM makes vector code of it. No sum is fused with a product: that would round once less.
_NOISY = r"""
#pragma clang fp contract(off)
const int first = row * length;
for (int i = 0; i < length; ++i) {
    const float light = linear.data[first + i];
    float noise = quantiles.data[drawn.data[first + i]] * sigmas.data[i];
    if (is_shot)
        noise *= __builtin_sqrtf(light > 0.0f ? light : 0.0f);
    noisy.data[first + i] = noise + light;
}
"""
_AMPLIFIED = r"""
const int first = row * length;
for (int i = 0; i < length; ++i) {
    const float light = linear.data[first + i], product = light * gains.data[i];
    const float limited = product < 1.0f ? product : 1.0f;
    result.data[first + i] = light >= clipped ? light : limited;
}
"""
_ENCODED = r"""
#pragma clang fp contract(off)
const int first = row * length;
for (int i = 0; i < length; ++i) {
    const float light = linear.data[first + i];
    const float within = light < 0.0f ? 0.0f : light > 1.0f ? 1.0f : light;
    const float step = within * steps + 0.5f;
    encoded.data[first + i] = table.data[(int)step];
}
"""


@wp.func_native(_NOISY)
def write_noisy(
    linear: wp.array[float],
    drawn: wp.array[wp.uint16],
    quantiles: wp.array[float],
    sigmas: wp.array[float],
    is_shot: bool,
    row: int,
    length: int,
    noisy: wp.array[float],
):
    """Add noise to a row."""
    ...


@wp.func_native(_AMPLIFIED)
def write_amplified(
    linear: wp.array[float],
    gains: wp.array[float],
    clipped: float,
    row: int,
    length: int,
    result: wp.array[float],
):
    """Amplify a row."""
    ...


@wp.func_native(_ENCODED)
def write_encoded(
    linear: wp.array[float],
    table: wp.array[wp.uint8],
    steps: float,
    row: int,
    length: int,
    encoded: wp.array[wp.uint8],
):
    """Look up a row in the table."""
    ...


@wp.kernel
def _noisy_kernel(
    first: int,
    linear: wp.array[float],
    drawn: wp.array[wp.uint16],
    quantiles: wp.array[float],
    sigmas: wp.array[float],  # of the values of a row
    is_shot: bool,
    length: int,
    # outputs
    noisy: wp.array[float],
):
    row = first + wp.tid()
    write_noisy(linear, drawn, quantiles, sigmas, is_shot, row, length, noisy)


@wp.kernel
def _amplified_kernel(
    first: int,
    linear: wp.array[float],
    gains: wp.array[float],  # of the values of a row
    clipped: float,
    length: int,
    # outputs
    result: wp.array[float],
):
    write_amplified(linear, gains, clipped, first + wp.tid(), length, result)


@wp.kernel
def _encoded_kernel(
    first: int,
    linear: wp.array[float],
    table: wp.array[wp.uint8],
    steps: float,
    length: int,
    # outputs
    encoded: wp.array[wp.uint8],
):
    write_encoded(linear, table, steps, first + wp.tid(), length, encoded)


def with_noise(
    linear: np.ndarray, sigma: ByChannel, drawn: np.ndarray, is_shot: bool
) -> np.ndarray:
    """Return the image plus white normal noise, (height, width, 3), float32.

    Args:
        linear: image in linear light, (height, width, 3), float32.
        sigma: standard deviation of the noise in each channel; of shot noise, at white.
        drawn: numbers of the quantiles (`normal_quantiles`), one for each value, uint16.
        is_shot: whether the noise grows with the square root of the light.
    """
    height, width, _ = linear.shape
    noisy = np.empty(linear.shape, np.float32)
    inputs = [_flat(linear), shared(drawn), _device_quantiles(), _by_value(sigma, width), is_shot]
    launch_rows(_noisy_kernel, height, [*inputs, 3 * width, shared(noisy)])
    return noisy


def times_gain(linear: np.ndarray, gain: ByChannel, clipped: float) -> np.ndarray:
    """Return an image times a gain for each channel, at most 1; what is ``clipped`` or above stays.

    Args:
        linear: image in linear light, (height, width, 3), float32.
        gain: of each channel.
        clipped: the least value that stays as it is; infinity: none does.
    """
    height, width, _ = linear.shape
    result = np.empty(linear.shape, np.float32)
    inputs = [_flat(linear), _by_value(gain, width), clipped, 3 * width]
    launch_rows(_amplified_kernel, height, [*inputs, shared(result)])
    return result


def looked_up(linear: np.ndarray, table: np.ndarray) -> np.ndarray:
    """Return the entries of a table for values from 0 to 1; others are clipped. uint8, of that shape.

    Args:
        linear: values of any shape.
        table: its first entry is for 0 and its last one for 1, uint8.
    """
    encoded = np.empty(linear.shape, np.uint8)
    inputs = [_flat(linear), shared(table), float(len(table) - 1), linear.size]
    if linear.size:
        launch_rows(_encoded_kernel, 1, [*inputs, shared(encoded)])
    return encoded


def _flat(linear: np.ndarray) -> wp.array:
    return shared(np.ascontiguousarray(linear, np.float32))


def _by_value(factors: ByChannel, width: int) -> wp.array:
    """Return the factors of all values of a row."""
    return shared(np.tile(np.array(factors, np.float32), width))


@cache
def _device_quantiles() -> wp.array:
    return shared(normal_quantiles())
