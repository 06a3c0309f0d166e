"""How the sensor runs kernels on NumPy arrays."""

from typing import Any

import numpy as np
import warp as wp

from digs_warp.device.parallel import launch_parallel
from digs_warp.device.warp_start import start_warp

start_warp()


def shared(values: np.ndarray) -> Any:
    """Return a flat array for kernels that looks at ``values``; those to be written to are contiguous."""
    return wp.array(values.reshape(-1), device="cpu", copy=False)


def launch_rows(kernel: Any, count: int, inputs: list[Any]) -> None:
    """Run a kernel over ``count`` rows, on the calling thread alone.

    A recording senses frames side by side, which keeps all cores busy; to share out a kernel of a
    millisecond among them costs half of one.
    """
    launch_parallel(kernel, count, inputs, threads=1)
