"""The mean of several images, and of several gradients: shares of them, added up."""

import warp as wp

from digs_warp.device.contiguous import floats_from
from digs_warp.device.image_planes import ALIGNMENT

wp.set_module_options({"enable_backward": False, "max_unroll": 1, "optimization_level": 3})

# Values of a gradient that one thread adds.
BLOCK = 4096

_PIECE = wp.constant(ALIGNMENT)
_BLOCK = wp.constant(BLOCK)


@wp.kernel
def add_share_kernel(
    first: int,
    box: wp.array[int],  # [4] x0, y0, x1, y1
    pitch: int,
    plane: int,
    origin: int,
    channels: int,
    share: float,
    begins: int,  # 1: the sum begins with this one
    source: wp.array[float],  # padded planes
    # outputs
    target: wp.array[float],  # padded planes of the same layout
):
    """Add ``share * source`` to one row of the target."""
    y = first + wp.tid()
    if y < box[1] or y >= box[3]:
        return
    pieces = (box[2] - box[0] + _PIECE - 1) // _PIECE
    for channel in range(channels):
        start = origin + channel * plane + y * pitch + box[0]
        for piece in range(pieces):
            here = floats_from(source, start + piece * _PIECE, _PIECE)
            there = floats_from(target, start + piece * _PIECE, _PIECE)
            if begins != 0:
                for x in range(_PIECE):
                    there[x] = share * here[x]
            else:
                for z in range(_PIECE):
                    there[z] = there[z] + share * here[z]


@wp.kernel
def mean_kernel(
    first: int,
    count: int,
    share: float,
    source: wp.array[float],
    # outputs
    target: wp.array[float],
):
    """Set a block of values to ``share * (target + source)``."""
    begin = (first + wp.tid()) * _BLOCK
    size = wp.min(_BLOCK, count - begin)
    here = floats_from(source, begin, size)
    there = floats_from(target, begin, size)
    if size == _BLOCK:  # only a loop of fixed length becomes vector code
        for i in range(_BLOCK):
            there[i] = share * (there[i] + here[i])
    else:
        for j in range(size):
            there[j] = share * (there[j] + here[j])
