"""Photographs as thumbnails: means over squares of pixels, in which noise is averaged away."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.device.parallel import default_threads


def green_means(image: np.ndarray, step: int) -> np.ndarray:
    """Return the means of the green channel over squares of ``step`` pixels, (height, width), float32."""
    height, width = image.shape[0] // step, image.shape[1] // step
    blocks = image[: height * step, : width * step, 1].reshape(height, step, width, step)
    return blocks.mean(axis=(1, 3), dtype=np.float32)


def thumbnails(
    frames: Sequence[Frame], thumbnail: Callable[[np.ndarray], np.ndarray]
) -> list[np.ndarray]:
    """Return what ``thumbnail`` makes of the photographs, read on all cores.

    Raises:
        DigsError: a file that cannot be read.
    """
    with ThreadPoolExecutor(default_threads()) as pool:
        return [*pool.map(lambda frame: thumbnail(frame.load_image()), frames)]
