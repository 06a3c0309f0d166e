"""Float images on a device, in the layout of the hot kernels: planar, padded, with aligned rows."""

from typing import Any

import numpy as np
import warp as wp

from digs_warp.device.parallel import packed

# Rows and columns are rounded up to one 512-bit vector of float32, the size of a raster tile.
ALIGNMENT = 16

# A border of zeros on each side: windows that reach over the image edge read zeros. At least the 13 px that
# `digs_warp.measure.ssim` reads beyond the edge: two SSIM windows, one of them rounded up to whole vectors.
PADDING = 16


@wp.struct
class PlaneLayout:
    """The memory layout of `ImagePlanes`, for kernels."""

    width: int  # of the current image
    height: int
    pitch: int  # floats from one image row to the next
    plane: int  # floats from one channel to the next
    origin: int  # index of pixel (0, 0)


class ImagePlanes:
    """``channels`` float32 planes of one size with a border of zeros, in one flat Warp array.

    Pixel (x, y) of channel c lies at ``origin + c * plane + y * pitch + x``. Kernels never write the
    border, so windows that reach over the image edge read zeros. A smaller image (`resize`) uses the top
    left of the same memory: the layout never changes.

    Attributes:
        width, height: size of the current image [px].
        max_width, max_height: the largest size that fits into the memory [px].
    """

    def __init__(self, width: int, height: int, channels: int, device: str = "cpu") -> None:
        self.max_width = width
        self.max_height = height
        self.width = width
        self.height = height
        self.channels = channels
        self.pitch = -(-width // ALIGNMENT) * ALIGNMENT + 2 * PADDING
        rows = -(-height // ALIGNMENT) * ALIGNMENT + 2 * PADDING
        self.plane = self.pitch * rows
        self.origin = PADDING * self.pitch + PADDING
        self.data = wp.zeros(self.plane * channels, dtype=float, device=device)

    @staticmethod
    def of(pixels: np.ndarray, device: str = "cpu") -> "ImagePlanes":
        """Return planes that hold pixels, shape (height, width, channels)."""
        planes = ImagePlanes(pixels.shape[1], pixels.shape[0], pixels.shape[2], device)
        planes.assign(pixels)
        return planes

    def layout(self) -> Any:
        """Return the `PlaneLayout` of the current image."""
        return packed(PlaneLayout, **{name: getattr(self, name) for name in PlaneLayout.vars})

    def part(self, box: tuple[int, int, int, int]) -> np.ndarray:
        """Return the pixels in a box (x0, y0, x1, y1), (height, width, channels); on a CPU no copy."""
        planes = self.data.numpy().reshape(self.channels, -1, self.pitch)
        x0, y0, x1, y1 = (PADDING + edge for edge in box)
        return np.moveaxis(planes[:, y0:y1, x0:x1], 0, 2)

    def add(self, box: tuple[int, int, int, int], pixels: np.ndarray) -> None:
        """Add pixels, (height, width, channels), to those in a box (x0, y0, x1, y1)."""
        planes = self.data.numpy()  # on a CPU no copy
        x0, y0, x1, y1 = (PADDING + edge for edge in box)
        part = planes.reshape(self.channels, -1, self.pitch)[:, y0:y1, x0:x1]
        part += np.moveaxis(pixels, 2, 0)
        if str(self.data.device) != "cpu":
            self.data.assign(planes)

    def resize(self, width: int, height: int) -> None:
        """Change the image size; the area outside becomes border.

        Raises:
            ValueError: the size does not fit into the memory.
        """
        if width > self.max_width or height > self.max_height:
            raise ValueError(
                f"image of {width}x{height} px in planes of {self.max_width}x{self.max_height} px"
            )
        right, bottom = PADDING + self.width, PADDING + self.height
        if self.channels:
            planes = self.data.reshape((self.channels, self.plane // self.pitch, self.pitch))
            if width < self.width:
                planes[:, PADDING:bottom, PADDING + width : right].zero_()
            if height < self.height:
                planes[:, PADDING + height : bottom, PADDING:right].zero_()
        self.width, self.height = width, height

    def assign(self, pixels: np.ndarray) -> None:
        """Fill from pixels, shape (height, width, channels) or (height, width)."""
        padded = np.zeros((self.channels, self.plane // self.pitch, self.pitch), dtype=np.float32)
        pixels = np.atleast_3d(pixels).transpose(2, 0, 1)
        inside = slice(PADDING, None)
        padded[:, inside, inside][:, : self.height, : self.width] = pixels
        self.data.assign(padded.reshape(-1))

    def to_numpy(self) -> np.ndarray:
        """Return a copy of the pixels, shape (height, width, channels), float32."""
        padded = self.data.numpy().reshape(self.channels, -1, self.pitch)
        p = PADDING
        inside = padded[:, p : p + self.height, p : p + self.width]
        pixels = np.empty((self.height, self.width, self.channels), dtype=np.float32)
        for channel, plane in enumerate(inside):  # in half of the time of one copy
            pixels[..., channel] = plane
        return pixels
