"""NumPy arrays as kernels take them."""

from typing import Any

import numpy as np
import warp as wp

from digs_warp.warp_start import start_warp

start_warp()


def shared(values: np.ndarray) -> Any:
    """Return a flat array for kernels that looks at ``values``; those to be written to are contiguous."""
    return wp.array(values.reshape(-1), device="cpu", copy=False)
