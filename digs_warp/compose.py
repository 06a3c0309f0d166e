# type: ignore
# (device code, which Warp's stubs do not type)
"""Photographs over a background: 8-bit colour and mask -> float planes."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def compose_kernel(
    first: int,
    width: int,
    pitch: int,
    plane: int,
    origin: int,
    pixels: wp.array[wp.uint8],  # [4 * height * width] planes red, green, blue, mask
    size: int,
    background: wp.array[float],  # [3]
    # outputs
    target: wp.array[float],  # 3 padded planes
):
    """Composite one row of a view over the background."""
    row = first + wp.tid()
    for x in range(width):
        p = row * width + x
        share = float(pixels[3 * size + p]) / 255.0
        for channel in range(3):
            value = float(pixels[channel * size + p]) / 255.0
            target[origin + channel * plane + row * pitch + x] = value * share + background[
                channel
            ] * (1.0 - share)
