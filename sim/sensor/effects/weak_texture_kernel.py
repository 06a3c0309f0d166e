"""Noise, strips and holes of weak texture in one pass over the frame.

The law is in `digs_warp.sim.sensor.effects.weak_texture`.

Seven fields are added up from their rows, piece by piece, and never stored: image by image, reading and
writing them took most of the time. The formulas in NumPy: tests/reference/weak_texture_twin.py.
"""

# Kernel code is a language of its own; these checks misread it.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.device.contiguous import bytes_from, floats_from
from digs_warp.device.kernel_options import vector_module_options
from digs_warp.sim.sensor.arrays import launch_rows, shared
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.row_field import PIECE, RowField, Rows, sum_rows

wp.set_module_options(vector_module_options())

_PIECE = wp.constant(PIECE)
_MEMORY = wp.constant(7 * PIECE)
_CAUSE = wp.constant(int(Cause.WEAK_TEXTURE))
_NOTHING = wp.constant(float("nan"))


@dataclass(frozen=True, eq=False)
class WeakTextureFields:
    """What decides about each pixel.

    Attributes:
        noise: normal field, the shape of the error.
        sigma: its size [px].
        strips: normal field; above a level it fails in strips.
        wrong_level: above which it is wrong.
        lost_level: above which it has no value.
        patches: normal field; above a level patches are lost.
        patch_level: that level.
    """

    noise: RowField
    sigma: RowField
    strips: RowField
    wrong_level: RowField
    lost_level: RowField
    patches: RowField
    patch_level: RowField


def apply_weak_texture(
    disparity: np.ndarray,
    cause: np.ndarray,
    confidence: np.ndarray,
    fields: WeakTextureFields,
    strip_error: float,
    strip_growth: float,
    label_from: float,
) -> None:
    """Change a frame in place.

    Args:
        disparity: [px], (height, width), float32, contiguous.
        cause: `Cause` of each pixel, (height, width), uint8, contiguous.
        confidence: 0 to 1, (height, width), float32, contiguous.
        fields: all of the frame's shape.
        strip_error: by which strips read too far at their rims [px].
        strip_growth: by which this grows per unit of the field above its level [px].
        label_from: noise above this has a label [px].
    """
    height, width = disparity.shape
    rows = [field.for_kernels() for field in vars(fields).values()]
    scalars = [strip_error, strip_growth, label_from]
    frame = [shared(image) for image in (disparity, cause, confidence)]
    launch_rows(_weak_texture_kernel, height, [width, *rows, *scalars, *frame])


@wp.func
def is_lost(strip: float, wrong: float, lost: float, patch: float, patch_level: float) -> bool:
    """Whether a pixel has no value left."""
    return (strip > wrong and strip > lost) or patch > patch_level


@wp.func
def new_disparity(
    old: float, noise: float, strip: float, wrong: float, error: float, growth: float
) -> float:
    """What a pixel that is not lost gets."""
    return wp.where(strip > wrong, old - (error + growth * (strip - wrong)), old + noise)


@wp.kernel
def _weak_texture_kernel(
    first: int,
    width: int,
    noise: Rows,
    sigma: Rows,
    strips: Rows,
    wrong_level: Rows,
    lost_level: Rows,
    patches: Rows,
    patch_level: Rows,
    strip_error: float,
    strip_growth: float,
    label_from: float,
    # inputs and outputs
    disparity: wp.array[float],  # [height * width]
    cause: wp.array[wp.uint8],  # [height * width]
    confidence: wp.array[float],  # [height * width]
):
    """Go through one row."""
    row = first + wp.tid()
    memory = wp.zeros(shape=(_MEMORY,), dtype=float)
    error = wp.array(ptr=memory.ptr, shape=(_PIECE,), dtype=float)
    size = floats_from(error, _PIECE, _PIECE)
    strip = floats_from(error, 2 * _PIECE, _PIECE)
    wrong = floats_from(error, 3 * _PIECE, _PIECE)
    lost = floats_from(error, 4 * _PIECE, _PIECE)
    patch = floats_from(error, 5 * _PIECE, _PIECE)
    limit = floats_from(error, 6 * _PIECE, _PIECE)
    for piece in range((width + _PIECE - 1) // _PIECE):
        column = piece * _PIECE
        sum_rows(noise, row, column, error)
        sum_rows(sigma, row, column, size)
        sum_rows(strips, row, column, strip)
        sum_rows(wrong_level, row, column, wrong)
        sum_rows(lost_level, row, column, lost)
        sum_rows(patches, row, column, patch)
        sum_rows(patch_level, row, column, limit)
        count = wp.min(_PIECE, width - column)
        old = floats_from(disparity, row * width + column, count)
        label = bytes_from(cause, row * width + column, count)
        trust = floats_from(confidence, row * width + column, count)
        if count == _PIECE:
            for x in range(_PIECE):
                known = old[x] == old[x]
                shift = error[x] * size[x]
                gone = is_lost(strip[x], wrong[x], lost[x], patch[x], limit[x])
                fails = known and (gone or strip[x] > wrong[x] or wp.abs(shift) > label_from)
                value = new_disparity(old[x], shift, strip[x], wrong[x], strip_error, strip_growth)
                old[x] = wp.where(gone, _NOTHING, value)
                label[x] = wp.where(fails, wp.uint8(_CAUSE), label[x])
                trust[x] = wp.where(fails, wp.where(gone, 0.0, 0.5), trust[x])
        else:
            for t in range(count):
                known_t = old[t] == old[t]
                shift_t = error[t] * size[t]
                gone_t = is_lost(strip[t], wrong[t], lost[t], patch[t], limit[t])
                fails_t = known_t and (
                    gone_t or strip[t] > wrong[t] or wp.abs(shift_t) > label_from
                )
                value_t = new_disparity(
                    old[t], shift_t, strip[t], wrong[t], strip_error, strip_growth
                )
                old[t] = wp.where(gone_t, _NOTHING, value_t)
                label[t] = wp.where(fails_t, wp.uint8(_CAUSE), label[t])
                trust[t] = wp.where(fails_t, wp.where(gone_t, 0.0, 0.5), trust[t])
