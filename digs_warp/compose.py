# type: ignore
# (device code, which Warp's stubs do not type)
"""Photographs over a background: 8-bit colour and mask -> float planes."""

import warp as wp

wp.set_module_options({"enable_backward": False, "max_unroll": 1, "optimization_level": 3})

# Tells LLVM that an index is no negative one, so that loops over a row are vectorized.
_NOT_NEGATIVE = wp.constant(0x7FFFFFFF)


@wp.func
def fill(plane: wp.array[float], start: int, count: int, value: float):
    """Set ``count`` floats."""
    begin = start & _NOT_NEGATIVE
    for x in range(count):
        plane[begin + x] = value


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
    # Columns first .. last show the photograph, those of the region on both sides the background.
    first = region[2]
    last = region[2]
    if y >= box[1] and y < box[3]:
        first = wp.clamp(box[0], region[0], region[2])
        last = wp.clamp(box[2], first, region[2])
    start = (origin + y * pitch) & _NOT_NEGATIVE
    fill(mask, start + region[0], first - region[0], 0.0)
    fill(mask, start + last, region[2] - last, 0.0)
    size = (box[2] - box[0]) * (box[3] - box[1])
    source = ((y - box[1]) * (box[2] - box[0]) + first - box[0]) & _NOT_NEGATIVE
    there = (start + first) & _NOT_NEGATIVE
    for xi in range(last - first):
        mask[there + xi] = float(pixels[source + 3 * size + xi]) * (1.0 / 255.0)
    for channel in range(3):
        back = background[channel]
        fill(target, start + channel * plane + region[0], first - region[0], back)
        fill(target, start + channel * plane + last, region[2] - last, back)
        at = (there + channel * plane) & _NOT_NEGATIVE
        taken = (source + channel * size) & _NOT_NEGATIVE
        for xb in range(last - first):
            share = wp.where(keeps_color != 0, 1.0, mask[there + xb])
            value = float(pixels[taken + xb]) * (1.0 / 255.0)
            target[at + xb] = back + share * (value - back)
