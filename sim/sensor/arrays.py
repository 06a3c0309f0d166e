"""How the sensor runs kernels on NumPy arrays."""

from typing import Any

import numpy as np
import warp as wp

from digs_warp.device.parallel import launch_parallel
from digs_warp.device.warp_start import start_warp

start_warp()


def shared(values: np.ndarray) -> Any:
    """Return a flat Warp array on the memory of ``values``; to be written to, it must be contiguous."""
    return wp.array(values.reshape(-1), device="cpu", copy=False)


def launch_rows(kernel: Any, count: int, inputs: list[Any]) -> None:
    """Run a kernel over ``count`` rows, on the calling thread only.

    A recording senses several frames at once, which keeps all cores busy. Splitting a kernel of 1 ms among
    them would cost half a millisecond.
    """
    launch_parallel(kernel, count, inputs, threads=1)
