"""Photographs over a background: 8-bit colour and mask -> float planes."""

import warp as wp

from digs_warp.device.contiguous import bytes_from, floats_from

wp.set_module_options({"enable_backward": False, "max_unroll": 1, "optimization_level": 3})

# Only loops of fixed length become vector code: a row is done in pieces of this many pixels, then the rest.
_PIECE = wp.constant(32)


@wp.func
def fill(plane: wp.array[float], start: int, count: int, value: float):
    """Set ``count`` floats."""
    whole = count // _PIECE
    for piece in range(whole):
        part = floats_from(plane, start + piece * _PIECE, _PIECE)
        for x in range(_PIECE):
            part[x] = value
    tail = floats_from(plane, start + whole * _PIECE, count - whole * _PIECE)
    for t in range(count - whole * _PIECE):
        tail[t] = value


@wp.func
def unit(value: wp.uint8) -> float:
    """An 8-bit value as 0..1."""
    return float(value) * (1.0 / 255.0)


@wp.func
def blend(color: float, back: float, share: float, keeps_color: int) -> float:
    """The colour over the background."""
    return back + wp.where(keeps_color != 0, 1.0, share) * (color - back)


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
    start = origin + y * pitch
    fill(mask, start + region[0], first - region[0], 0.0)
    fill(mask, start + last, region[2] - last, 0.0)
    width = last - first
    size = (box[2] - box[0]) * (box[3] - box[1])
    source = (y - box[1]) * (box[2] - box[0]) + first - box[0]
    whole = width // _PIECE
    for piece in range(whole + 1):
        at = start + first + piece * _PIECE
        taken = source + piece * _PIECE
        count = wp.min(_PIECE, width - piece * _PIECE)
        shares = floats_from(mask, at, count)
        packed = bytes_from(pixels, taken + 3 * size, count)
        if count == _PIECE:
            for xm in range(_PIECE):
                shares[xm] = unit(packed[xm])
        else:
            for tm in range(count):
                shares[tm] = unit(packed[tm])
        for channel in range(3):
            back = background[channel]
            goal = floats_from(target, at + channel * plane, count)
            photo = bytes_from(pixels, taken + channel * size, count)
            if count == _PIECE:
                for xc in range(_PIECE):
                    goal[xc] = blend(unit(photo[xc]), back, shares[xc], keeps_color)
            else:
                for tc in range(count):
                    goal[tc] = blend(unit(photo[tc]), back, shares[tc], keeps_color)
    for side in range(3):
        fill(target, start + side * plane + region[0], first - region[0], background[side])
        fill(target, start + side * plane + last, region[2] - last, background[side])
