"""How well a patch can be matched: its horizontal gradient against the noise of the image.

Stereo matching compares along rows, so only gradients along x carry information. Thresholds are from
experiments with semi-global matching (OpenCV StereoSGBM, window 5) on textures of known contrast.

One kernel measures gradients in windows and in blocks. All its sums are of whole numbers below 2^24, so they
are exact in float32 in any order.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.device.contiguous import bytes_from, floats_from
from digs_warp.device.kernel_options import vector_module_options
from digs_warp.sim.sensor.arrays import launch_rows, shared
from digs_warp.sim.sensor.filters import box_mean, distance_to

wp.set_module_options(vector_module_options())

# Gradient over image noise above which a patch is matched: 99 % of the pixels at 0.24, 9 % at 0.12.
MATCHABLE_SNR = 0.25

# Noise of the luma per noise of a channel: the root of the sum of squared weights (Rec. 601).
LUMA_NOISE = float(np.hypot(np.hypot(0.299, 0.587), 0.114))

# Rounding to 8 bits; no patch has less noise.
ROUNDING_NOISE = 1 / np.sqrt(12)

# Side of a block, for which there is one value [px].
BLOCK = 4

# Smaller gradients are lost in the rounding of 8-bit images, even in the mean over a region [DN/px].
LEAST_GRADIENT = 0.1

_BLOCK = wp.constant(BLOCK)
_LEAST = wp.constant(LEAST_GRADIENT)

# Only loops of fixed length become vector code: kernels walk a row in pieces of this many pixels, then pixel
# by pixel.
PIECE = 64
_PIECE = wp.constant(PIECE)


@dataclass(frozen=True, eq=False)
class Texture:
    """How much gray values change along the rows.

    Attributes:
        gradient: RMS in the matching window [DN/px], (height, width), float32.
        logarithms: mean of ln(gradient + LEAST_GRADIENT) of single pixels, one for each BLOCK x BLOCK
            pixels; the last block of a row or column may have fewer. float32.
        energies: mean square of ``gradient``, in the same blocks [DN^2/px^2], float32.
    """

    gradient: np.ndarray
    logarithms: np.ndarray
    energies: np.ndarray

    def typical(self, size: int) -> np.ndarray:
        """Return the logarithm of the typical gradient of regions of ``size`` pixels, one for each block.

        The geometric mean is typical: a few strong edges do not help a plain surface.
        """
        return box_mean(self.logarithms, size // BLOCK | 1)


@wp.func
def squared(left: wp.uint8, right: wp.uint8) -> float:
    """Squared difference of two gray values: four times the squared gradient between them."""
    difference = float(right) - float(left)
    return difference * difference


@wp.func
def fill(values: wp.array[float], count: int, value: float):
    """Set the first ``count`` values, rounded up to whole pieces."""
    for piece in range((count + _PIECE - 1) // _PIECE):
        part = floats_from(values, piece * _PIECE, _PIECE)
        for x in range(_PIECE):
            part[x] = value


@wp.func
def add_row(gray: wp.array[wp.uint8], start: int, width: int, sign: float, sums: wp.array[float]):
    """Add or subtract the squares of one row; at its ends they are 0, because the image is mirrored there."""
    inner = wp.max(width - 2, 0)
    whole = inner // _PIECE
    for piece in range(whole):
        left = bytes_from(gray, start + piece * _PIECE, _PIECE)
        right = bytes_from(gray, start + piece * _PIECE + 2, _PIECE)
        part = floats_from(sums, piece * _PIECE + 1, _PIECE)
        for x in range(_PIECE):
            part[x] += sign * squared(left[x], right[x])
    for i in range(whole * _PIECE, inner):
        sums[i + 1] += sign * squared(gray[start + i], gray[start + i + 2])


@wp.func
def multiply_row(gray: wp.array[wp.uint8], start: int, width: int, product: wp.array[float]):
    """Multiply by the gradients of one row, each plus LEAST_GRADIENT."""
    product[0] *= _LEAST
    if width > 1:
        product[width - 1] *= _LEAST
    inner = wp.max(width - 2, 0)
    whole = inner // _PIECE
    for piece in range(whole):
        left = bytes_from(gray, start + piece * _PIECE, _PIECE)
        right = bytes_from(gray, start + piece * _PIECE + 2, _PIECE)
        part = floats_from(product, piece * _PIECE + 1, _PIECE)
        for x in range(_PIECE):
            part[x] *= 0.5 * wp.abs(float(right[x]) - float(left[x])) + _LEAST
    for i in range(whole * _PIECE, inner):
        step = wp.abs(float(gray[start + i + 2]) - float(gray[start + i]))
        product[i + 1] *= 0.5 * step + _LEAST


@wp.func
def mean_of_window(columns: wp.array[float], column: int, window: int, mean: wp.array[float]):
    """Write the means over the window for a piece of a row, from the sums over the window's rows."""
    scale = 1.0 / (4.0 * float(window) * float(window))
    out = floats_from(mean, 0, _PIECE)
    for x in range(_PIECE):
        out[x] = 0.0
    for shift in range(window):
        part = floats_from(columns, column + shift, _PIECE)
        for xs in range(_PIECE):
            out[xs] += scale * part[xs]


@wp.func
def add(values: wp.array[float], total: wp.array[float]):
    """Add a piece of a row to another."""
    source = floats_from(values, 0, _PIECE)
    out = floats_from(total, 0, _PIECE)
    for x in range(_PIECE):
        out[x] += source[x]


@wp.func
def write_roots(values: wp.array[float], roots: wp.array[float], count: int):
    """Write the square roots of the first ``count`` values of a piece."""
    if count == _PIECE:
        source = floats_from(values, 0, _PIECE)
        out = floats_from(roots, 0, _PIECE)
        for x in range(_PIECE):
            out[x] = wp.sqrt(source[x])
    else:
        for t in range(count):
            roots[t] = wp.sqrt(values[t])


@wp.kernel
def _texture_kernel(
    first: int,
    gray: wp.array[wp.uint8],  # [height * width]
    height: int,
    width: int,
    window: int,
    pitch: int,  # floats of a scratch row: width + window + 2 PIECE or more
    scratch: wp.array[float],  # [block rows * 4 * pitch]
    # outputs
    gradient: wp.array[float],  # [height * width] RMS in the window [DN/px]
    logarithms: wp.array[float],  # [blocks] mean of ln(gradient + LEAST_GRADIENT)
    energies: wp.array[float],  # [blocks] mean square of ``gradient``
):
    """Process one row of blocks."""
    block_row = first + wp.tid()
    half = window // 2
    # The rows of a launch run one after another and share the scratch memory of the first one.
    memory = first * 4 * pitch
    columns = floats_from(
        scratch, memory, pitch
    )  # sums over the window's rows, ends of 0 at both sides
    inside = floats_from(scratch, memory + half, pitch - half)
    means = floats_from(scratch, memory + pitch, pitch)
    product = floats_from(scratch, memory + 2 * pitch, pitch)
    energy = floats_from(scratch, memory + 3 * pitch, pitch)
    fill(columns, width + window, 0.0)
    fill(product, width, 1.0)
    fill(energy, width, 0.0)
    top = block_row * _BLOCK
    bottom = wp.min(top + _BLOCK, height)
    for k in range(window):
        row = wp.clamp(top + k - half, 0, height - 1)
        add_row(gray, row * width, width, 1.0, inside)
    for y in range(top, bottom):
        if y > top:
            leaves = wp.clamp(y - 1 - half, 0, height - 1)
            enters = wp.clamp(y + half, 0, height - 1)
            if enters != leaves:
                add_row(gray, leaves * width, width, -1.0, inside)
                add_row(gray, enters * width, width, 1.0, inside)
        multiply_row(gray, y * width, width, product)
        for piece in range((width + _PIECE - 1) // _PIECE):
            column = piece * _PIECE
            mean = floats_from(means, 0, _PIECE)
            mean_of_window(columns, column, window, mean)
            add(mean, floats_from(energy, column, _PIECE))
            count = wp.min(_PIECE, width - column)
            write_roots(mean, floats_from(gradient, y * width + column, count), count)
    rows = float(bottom - top)
    blocks = (width + _BLOCK - 1) // _BLOCK
    for block in range(blocks):
        left_end = block * _BLOCK
        right_end = wp.min(left_end + _BLOCK, width)
        block_product = float(1.0)
        block_energy = float(0.0)
        for i in range(left_end, right_end):
            # 16 factors from 0.1 to 128 stay within float32.
            block_product *= product[i]
            block_energy += energy[i]
        pixels = rows * float(right_end - left_end)
        logarithms[block_row * blocks + block] = wp.log(block_product) / pixels
        energies[block_row * blocks + block] = block_energy / pixels


def measure_texture(gray: np.ndarray, window: int) -> Texture:
    """Return the texture of an image.

    Gradients are central differences, mirrored at the borders; windows repeat the border.

    Args:
        gray: (height, width), uint8.
        window: width of the matching window [px], odd.
    """
    height, width = gray.shape
    blocks = (-(-height // BLOCK), -(-width // BLOCK))
    pitch = width + window + 2 * PIECE
    gradient = wp.empty(height * width, dtype=float, device="cpu")
    logarithms, energies = (
        wp.empty(blocks[0] * blocks[1], dtype=float, device="cpu") for _ in range(2)
    )
    scratch = wp.empty(blocks[0] * 4 * pitch, dtype=float, device="cpu")
    inputs = [shared(gray), height, width, window, pitch, scratch, gradient, logarithms, energies]
    launch_rows(_texture_kernel, blocks[0], inputs)
    return Texture(
        gradient.numpy().reshape(height, width),
        logarithms.numpy().reshape(blocks),
        energies.numpy().reshape(blocks),
    )


def noise_of(image_noise: float) -> float:
    """Return the noise of the luma, which a gradient must exceed to be matched [DN].

    Args:
        image_noise: of each color channel [DN]; the channels' noise is independent.
    """
    return max(LUMA_NOISE * image_noise, ROUNDING_NOISE)


def texture_distance(snr: np.ndarray) -> np.ndarray:
    """Return the distance of each pixel to a matchable one [px], float32; inf where there is none."""
    return distance_to(snr > MATCHABLE_SNR)
