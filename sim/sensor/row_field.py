"""Smooth fields over an image, kept as rows of which every row of the image is a weighted sum.

Stretching a coarse grid along its rows takes few values, as the grid has few rows; stretching it along the
columns as well takes every pixel, but is then a sum of whole rows, which kernels do in passing. A full image
of a field that only one kernel reads need never be stored.
"""

# Kernel code is a language of its own; these checks misread it.
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

# Rows, and columns, that each value is a weighted sum of.
TAPS = 4

# Kernels go through the rows in pieces of so many pixels; stored rows are whole numbers of pieces.
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
    """Where along an axis the values are that each place is a weighted sum of.

    Attributes:
        first: of TAPS neighbours, (size,), int32.
        weights: of each of them, (size, TAPS), float32.
    """

    first: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True, eq=False)
class RowField:
    """A field over an image.

    Attributes:
        rows: stored rows, (n, pitch), float32; the columns after the width of the image mean nothing.
        taps: which of them make up each row of the image.
        shape: (height, width) of the image.
    """

    rows: np.ndarray
    taps: Taps
    shape: tuple[int, int]

    def for_kernels(self) -> Any:
        """Return the field as kernels take it; it looks at the arrays of this one."""
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
        down: which of its n rows make up each row of the image.
        across: which of its m columns make up each column of the image.
        shape: (height, width) of the image.
    """
    count, columns = grid.shape
    pitch = -(-shape[1] // PIECE) * PIECE
    more = pitch - shape[1]
    # What lies right of the image repeats its last column.
    first = np.pad(across.first, (0, more), mode="edge")
    # One tap after the other: a piece of a row is then read and written as a whole.
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
    """Return a grid as a field, linear between the middles of its cells.

    Before the first and after the last middle the value stays.

    Args:
        grid: one value for each ``step`` x ``step`` pixels, the last of a row or column for fewer, float32.
        step: side of a cell [px], a divisor of PIECE.
        shape: (height, width) of the image.
    """
    rows, columns = grid.shape
    pitch = -(-shape[1] // PIECE) * PIECE
    missing = [(0, max(TAPS - rows, 0)), (0, pitch // step - columns)]
    whole = np.pad(grid, missing, mode="edge") if missing != [(0, 0), (0, 0)] else grid
    return RowField(enlarge(whole, (len(whole), pitch)), _linear_taps(shape[0], rows, step), shape)


def _linear_taps(size: int, cells: int, step: int) -> Taps:
    """Return taps for linear interpolation between the middles of ``cells`` cells of ``step`` pixels."""
    place = np.clip((np.arange(size) + 0.5) / step - 0.5, 0, cells - 1)
    first = np.minimum(place.astype(np.int32), max(cells - TAPS, 0))
    # The weight of a cell falls to 0 within the distance of a cell.
    distance = np.abs(place[:, None] - first[:, None] - np.arange(TAPS))
    return Taps(first.astype(np.int32), np.maximum(1 - distance, 0).astype(np.float32))


def spline_taps(size: int, step: float, offset: float) -> tuple[Taps, int]:
    """Return taps of cubic B-splines on points ``step`` pixels apart, and the number of points.

    Their weights are divided by their norm: independent values of variance 1 on the points give values of
    variance 1 everywhere.

    Args:
        size: of the axis [px].
        step: between the points [px].
        offset: of the first place from the second point, 0 to 1 steps.
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
    """Write a piece of one row of the image, from a column on, to ``total``, [PIECE]."""
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
        # Taken to memory of its own first: what is read at places that LLVM cannot foresee must not be
        # what is written.
        memory = wp.zeros(shape=(_PIECE,), dtype=float)
        for x in range(_PIECE):
            at = starts[column + x]
            left = w0[x] * line[at] + w1[x] * line[at + 1]
            memory[x] = left + (w2[x] * line[at + 2] + w3[x] * line[at + 3])
        out = floats_from(rows, row * pitch + column, _PIECE)
        for xo in range(_PIECE):
            out[xo] = memory[xo]
