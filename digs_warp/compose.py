# type: ignore
# (device code, which Warp's stubs do not type)
"""Photographs over a background: 8-bit colour and mask -> float planes."""

import warp as wp

wp.set_module_options({"enable_backward": False, "max_unroll": 1, "optimization_level": 3})

# Tells LLVM that an index is no negative one, so that loops over a row are vectorized.
_NOT_NEGATIVE = wp.constant(0x7FFFFFFF)


@wp.kernel
def compose_kernel(
    row: int,
    pitch: int,
    plane: int,
    origin: int,
    region: wp.array[int],  # [4] x0, y0, x1, y1: pixels to fill
    pixels: wp.array[wp.uint8],  # [4 * size] planes red, green, blue, mask of the box
    box: wp.array[int],  # [4] x0, y0, x1, y1: where the photograph lies
    keeps_color: int,  # 1: the photograph as it is, 0: blended into the background by its mask
    background: wp.array[float],  # [3]
    # outputs
    target: wp.array[float],  # 3 padded planes
    mask: wp.array[float],  # 1 padded plane
):
    """Fill one row of the region."""
    y = row + wp.tid()
    if y < region[1] or y >= region[3]:
        return
    left = region[0]
    count = region[2] - left
    start = (origin + y * pitch + left) & _NOT_NEGATIVE
    for channel in range(3):
        color = background[channel]
        shifted = (start + channel * plane) & _NOT_NEGATIVE
        for x in range(count):
            target[shifted + x] = color
    for xm in range(count):
        mask[start + xm] = 0.0
    if y < box[1] or y >= box[3]:
        return
    size = (box[2] - box[0]) * (box[3] - box[1])
    first = wp.max(box[0], left)
    inside = wp.min(box[2], region[2]) - first
    source = ((y - box[1]) * (box[2] - box[0]) + first - box[0]) & _NOT_NEGATIVE
    there = (origin + y * pitch + first) & _NOT_NEGATIVE
    for xi in range(inside):
        mask[there + xi] = float(pixels[source + 3 * size + xi]) * (1.0 / 255.0)
    for c in range(3):
        back = background[c]
        at = (there + c * plane) & _NOT_NEGATIVE
        taken = (source + c * size) & _NOT_NEGATIVE
        for xb in range(inside):
            share = wp.where(keeps_color != 0, 1.0, mask[there + xb])
            value = float(pixels[taken + xb]) * (1.0 / 255.0)
            target[at + xb] = back + share * (value - back)
