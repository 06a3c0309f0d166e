"""How filters run along the columns of an image: many columns at once, so that each step is a vector."""

from typing import Any

import numpy as np

from digs_warp.sim.sensor.arrays import launch_rows, shared

# Columns that a thread filters together: whole vectors, and rows that stay in the first cache.
GROUP = 256


def run_along_columns(kernel: Any, images: list[np.ndarray], numbers: list[Any]) -> None:
    """Run a kernel on groups of columns of contiguous images (height, width), which it changes in place.

    Its arguments are: first group, the images as flat arrays, width, height, and the numbers.
    """
    height, width = images[0].shape
    groups = -(-width // GROUP)
    launch_rows(kernel, groups, [*map(shared, images), width, height, *numbers])
