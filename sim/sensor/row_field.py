"""Smooth fields over an image, stored as a few rows; every row of the image is a weighted sum of them.

Stretching a coarse grid along its rows is cheap, because the grid has few rows. Stretching it along the
columns touches every pixel, but is a sum of whole rows, which kernels compute as they go: the full image of
a field that only one kernel reads is never stored.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from digs_warp.device.contiguous import floats_from
from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.warp_start import start_warp
from digs_warp.sim.sensor.arrays import launch_rows, shared
from digs_warp.sim.sensor.filters import enlarge

start_warp()
wp.set_module_options(vector_module_options())

# Each value is a weighted sum of this many rows and columns.
TAPS = 4

# Kernels process rows in pieces of this many pixels; stored rows are whole numbers of pieces.
PIECE = 64
_TAPS, _PIECE = wp.constant(TAPS), wp.constant(PIECE)


@wp.struct
class Rows:
    """A `RowField` for kernels."""

    values: wp.array[float]  # [stored rows * pitch]
    pitch: int
    first: wp.array[int]  # [height]
    weights: wp.array[float]  # [height * TAPS]


@dataclass(frozen=True, eq=False)
class Taps:
    """Weights of a sum of TAPS neighboring values, for each place along an axis.

    Attributes:
        first: index of the first neighbor, (size,), int32.
        weights: of each of them, (size, TAPS), float32.
    """

    first: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True, eq=False)
class RowField:
    """A field over an image.

    Attributes:
        rows: stored rows, (n, pitch), float32; columns beyond the width of the image are padding.
        taps: the weights of the stored rows in each row of the image.
        shape: (height, width) of the image.
    """

    rows: np.ndarray
    taps: Taps
    shape: tuple[int, int]

    def for_kernels(self) -> Any:
        """Return the field for kernels; it shares the memory of this one."""
        rows = Rows()
        rows.values = shared(self.rows)
        rows.pitch = self.rows.shape[1]
        rows.first = shared(self.taps.first)
        rows.weights = shared(self.taps.weights)
        return rows

    def image(self) -> np.ndarray:
        """Return the field at every pixel, (height, width), float32."""
        height, width = self.shape
        whole = wp.empty(height * self.rows.shape[1], dtype=float, device="cpu")
        launch_rows(_image_kernel, height, [self.for_kernels(), whole])
        return whole.numpy().reshape(height, -1)[:, :width]


def stretched(grid: np.ndarray, down: Taps, across: Taps, shape: tuple[int, int]) -> RowField:
    """Return a coarse grid as a field.

    Args:
        grid: (n, m), float32.
        down: weights of its n rows in each row of the image.
        across: weights of its m columns in each column of the image.
        shape: (height, width) of the image.
    """
    count, columns = grid.shape
    pitch = -(-shape[1] // PIECE) * PIECE
    more = pitch - shape[1]
    # The padding right of the image repeats its last column.
    first = np.pad(across.first, (0, more), mode="edge")
    # One tap after another: a piece of a row is then read and written as a whole.
    weights = np.ascontiguousarray(np.pad(across.weights, ((0, more), (0, 0)), mode="edge").T)
    rows = wp.empty(count * pitch, dtype=float, device="cpu")
    inputs = [
        shared(np.ascontiguousarray(grid, np.float32)),
        columns,
        shared(first),
        shared(weights),
        pitch,
    ]
    launch_rows(_stretch_kernel, count, [*inputs, rows])
    return RowField(rows.numpy().reshape(count, pitch), down, shape)


def interpolated(grid: np.ndarray, step: int, shape: tuple[int, int]) -> RowField:
    """Return a grid as a field, interpolated linearly between the centers of its cells.

    Beyond the first and the last center the value is constant.

    Args:
        grid: one value per ``step`` x ``step`` pixels, float32; the last cells may have fewer pixels.
        step: side of a cell [px], a divisor of PIECE.
        shape: (height, width) of the image.
    """
    rows, columns = grid.shape
    pitch = -(-shape[1] // PIECE) * PIECE
    missing = [(0, max(TAPS - rows, 0)), (0, pitch // step - columns)]
    whole = np.pad(grid, missing, mode="edge") if missing != [(0, 0), (0, 0)] else grid
    return RowField(enlarge(whole, (len(whole), pitch)), _linear_taps(shape[0], rows, step), shape)


def _linear_taps(size: int, cells: int, step: int) -> Taps:
    """Return taps for linear interpolation between the centers of ``cells`` cells of ``step`` pixels."""
    place = np.clip((np.arange(size) + 0.5) / step - 0.5, 0, cells - 1)
    first = np.minimum(place.astype(np.int32), max(cells - TAPS, 0))
    # The weight of a cell falls to 0 at the centers of its neighbors.
    distance = np.abs(place[:, None] - first[:, None] - np.arange(TAPS))
    return Taps(first.astype(np.int32), np.maximum(1 - distance, 0).astype(np.float32))


def spline_taps(size: int, step: float, offset: float) -> tuple[Taps, int]:
    """Return the taps of cubic B-splines on knots ``step`` pixels apart, and the number of knots.

    The weights are divided by their norm: independent knot values of variance 1 give variance 1 everywhere.

    Args:
        size: of the axis [px].
        step: between the knots [px].
        offset: of the first pixel from the second knot, 0 to 1 steps.
    """
    place = np.arange(size) / step + offset
    first = place.astype(np.int32)
    t = place - first
    weights = np.stack(
        [(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, 3 * (1 - t) ** 3 - 6 * (1 - t) ** 2 + 4, t**3],
        axis=1,
    )
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    return Taps(first, weights.astype(np.float32)), int(first[-1]) + TAPS


@wp.func
def sum_rows(field: Rows, row: int, column: int, total: wp.array[float]):
    """Write PIECE pixels of one row of the image, starting at a column, to ``total``."""
    start = field.first[row] * field.pitch + column
    first = floats_from(field.values, start, _PIECE)
    second = floats_from(field.values, start + field.pitch, _PIECE)
    third = floats_from(field.values, start + 2 * field.pitch, _PIECE)
    fourth = floats_from(field.values, start + 3 * field.pitch, _PIECE)
    w0 = field.weights[row * _TAPS]
    w1 = field.weights[row * _TAPS + 1]
    w2 = field.weights[row * _TAPS + 2]
    w3 = field.weights[row * _TAPS + 3]
    for x in range(_PIECE):
        total[x] = w0 * first[x] + w1 * second[x] + w2 * third[x] + w3 * fourth[x]


@wp.kernel
def _image_kernel(first: int, field: Rows, image: wp.array[float]):
    """Write every row of a field."""
    row = first + wp.tid()
    for piece in range(field.pitch // _PIECE):
        column = piece * _PIECE
        sum_rows(field, row, column, floats_from(image, row * field.pitch + column, _PIECE))


@wp.kernel
def _stretch_kernel(
    first: int,
    grid: wp.array[float],  # [rows * columns]
    columns: int,
    starts: wp.array[int],  # [pitch] first tap of each column
    weights: wp.array[float],  # [TAPS * pitch]
    pitch: int,
    # outputs
    rows: wp.array[float],  # [rows * pitch]
):
    """Stretch one row of a grid to the width of the image."""
    row = first + wp.tid()
    line = floats_from(grid, row * columns, columns)
    for piece in range(pitch // _PIECE):
        column = piece * _PIECE
        w0 = floats_from(weights, column, _PIECE)
        w1 = floats_from(weights, pitch + column, _PIECE)
        w2 = floats_from(weights, 2 * pitch + column, _PIECE)
        w3 = floats_from(weights, 3 * pitch + column, _PIECE)
        # Into separate memory first: LLVM vectorizes only if scattered reads cannot overlap the writes.
        memory = wp.zeros(shape=(_PIECE,), dtype=float)
        for x in range(_PIECE):
            at = starts[column + x]
            left = w0[x] * line[at] + w1[x] * line[at + 1]
            memory[x] = left + (w2[x] * line[at + 2] + w3[x] * line[at + 3])
        out = floats_from(rows, row * pitch + column, _PIECE)
        for xo in range(_PIECE):
            out[xo] = memory[xo]
