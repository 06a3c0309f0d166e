"""Runs kernels in which a block of threads works on one tile, `BLOCK_THREADS` threads on one pixel each.

Warp runs such blocks on a CPU, too, one thread after the other, where ``wp.config.enable_cpu_blocks`` is on:
for tests, it is slow.
"""

from typing import Any

import warp as wp

from digs_warp.splat.config import TILE_PIXELS

BLOCK_THREADS = TILE_PIXELS


def cooperative_module_options() -> dict[str, Any]:
    """Return the Warp module options of kernels that run in blocks of `BLOCK_THREADS` threads."""
    return {"enable_backward": False, "block_dim": BLOCK_THREADS}


class CooperativeLaunch:
    """A recorded launch of a kernel of this kind over ``tiles`` tiles.

    Raises:
        ValueError: the device is a CPU, and Warp is not told to run blocks of threads there.
    """

    def __init__(self, kernel: wp.Kernel, tiles: int, inputs: list[Any], device: str) -> None:
        if device == "cpu" and not wp.config.enable_cpu_blocks:
            raise ValueError("cooperative kernels need wp.config.enable_cpu_blocks = True on a CPU")
        self._inputs = inputs  # keeps the arrays alive: a recorded launch holds raw addresses
        launch = wp.launch_tiled(
            kernel,
            dim=[tiles],
            inputs=inputs,
            block_dim=BLOCK_THREADS,
            device=device,
            record_cmd=True,
        )
        assert launch is not None  # because of record_cmd
        self._launch = launch

    def run(self) -> None:
        """Execute."""
        self._launch.launch()
