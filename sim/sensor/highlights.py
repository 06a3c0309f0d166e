"""Light above white: what an 8-bit image cuts off, and a shorter exposure shows."""

from dataclasses import dataclass

import numpy as np

WHITE_BYTE = 255


@dataclass(frozen=True, eq=False)
class Highlights:
    """The light where a channel of an image is white, before it was clipped.

    Attributes:
        pixels: flat indices into the image, (n,).
        light: linear, 1 is white; all three channels, (n, 3), float32.
    """

    pixels: np.ndarray
    light: np.ndarray

    @staticmethod
    def of(image: np.ndarray, light: np.ndarray) -> "Highlights":
        """Return those of an image, (height, width, 3), uint8; ``light``: before encoding, (pixels, 3)."""
        # White is rare: a list of white values is shorter than a mask of pixels.
        pixels = np.unique(np.flatnonzero(image == WHITE_BYTE) // 3)
        return Highlights(pixels, light[pixels].astype(np.float32))

    def restored(self, linear: np.ndarray) -> np.ndarray:
        """Return a linear image, (height, width, 3), float32, with its highlights as bright as they were."""
        bright = linear.copy()
        bright.reshape(-1, 3)[self.pixels] = self.light
        return bright
