"""Blurred photographs: the strongest edges of a sharp one are as steep as its pixels allow."""

import numpy as np

# The strongest edges: those above this quantile of all steps between neighboring pixels.
STRONGEST = 0.995

# Steps at 4 times the size of the pixels are compared. They are as large as those of single pixels in a sharp
# image, and 4 times as large in one that is blurred over more than 4 pixels.
COARSER = 4

# Images with steps below this [of 255] at the coarser size show nothing that could be sharp.
PLAIN = 8.0


def sharpness(image: np.ndarray) -> float | None:
    """Return how sharp an image is: 1 for the sharpest, 1 / COARSER for a blur over more pixels than that.

    Noise counts as sharp.

    Args:
        image: sRGB, shape (height, width, 3), uint8.

    Returns:
        None for an image that is too plain or too small to tell.
    """
    green = image[..., 1].astype(np.float32)
    height, width = (side // COARSER for side in green.shape)
    if min(height, width) < 2 * COARSER:
        return None
    blocks = green[: height * COARSER, : width * COARSER]
    coarse = blocks.reshape(height, COARSER, width, COARSER).mean(axis=(1, 3))
    strong = _strongest_step(coarse)
    return _strongest_step(green) / strong if strong >= PLAIN else None


def _strongest_step(image: np.ndarray) -> float:
    """Return the step between neighboring pixels that few exceed."""
    across, down = np.abs(np.diff(image, axis=1)), np.abs(np.diff(image, axis=0))
    return float(np.quantile(np.concatenate([across.reshape(-1), down.reshape(-1)]), STRONGEST))
