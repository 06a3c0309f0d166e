"""Linear light as sRGB bytes, for kernels: by tables, without a power for each value."""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false, reportReturnType=false

from functools import cache

import numpy as np
import warp as wp

from digs_warp.data.images import linear_from_srgb

wp.set_module_options({"enable_backward": False})

# Steps of linear light from 0 to 1 at which the search for a byte starts: sRGB is at most three bytes further
# at the end of a step.
STARTS = wp.constant(4096.0)


@wp.struct
class Encoding:
    """Where the bytes change."""

    limits: wp.array[
        float
    ]  # [256] linear light from which the next byte is nearer; never for the last
    starts: wp.array[wp.uint8]  # [STARTS + 1] byte at the beginning of each step


@wp.func
def srgb_byte(encoding: Encoding, linear: float) -> wp.uint8:
    """Clip a linear value and return the sRGB byte that is nearest after encoding."""
    value = wp.clamp(linear, 0.0, 1.0)
    byte = int(encoding.starts[int(value * STARTS)])
    while encoding.limits[byte] <= value:
        byte += 1
    return wp.uint8(byte)


@cache
def srgb_encoding() -> Encoding:
    """Return the tables."""
    limits = np.append(linear_from_srgb((np.arange(255) + 0.5) / 255), np.inf).astype(np.float32)
    steps = np.arange(int(STARTS) + 1, dtype=np.float32) / np.float32(STARTS)
    encoding = Encoding()
    encoding.limits = wp.array(limits, dtype=float, device="cpu")
    starts = np.searchsorted(limits, steps, side="right").astype(np.uint8)
    encoding.starts = wp.array(starts, dtype=wp.uint8, device="cpu")
    return encoding
