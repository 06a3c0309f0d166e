"""Between planar, padded images and plain arrays (height, width, channels), one thread per row."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def unpack_planes_kernel(
    first: int,
    pitch: int,
    plane: int,
    origin: int,
    planes: wp.array[float],
    scale: float,
    offset: float,
    # outputs
    pixels: wp.array3d[float],  # (height, width, channels)
):
    """Copy ``scale * planes + offset``."""
    y = first + wp.tid()
    for x in range(pixels.shape[1]):
        for channel in range(pixels.shape[2]):
            pixels[y, x, channel] = (
                scale * planes[origin + channel * plane + y * pitch + x] + offset
            )


@wp.kernel
def pack_planes_kernel(
    first: int,
    pitch: int,
    plane: int,
    origin: int,
    pixels: wp.array3d[float],
    scale: float,
    # outputs
    planes: wp.array[float],
):
    """Copy ``scale * pixels``."""
    y = first + wp.tid()
    for x in range(pixels.shape[1]):
        for channel in range(pixels.shape[2]):
            planes[origin + channel * plane + y * pitch + x] = scale * pixels[y, x, channel]


@wp.kernel
def add_kernel(source: wp.array[float], target: wp.array[float]):
    """Add one array to another."""
    i = wp.tid()
    target[i] = target[i] + source[i]
