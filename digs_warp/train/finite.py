"""Finds NaN and infinity on the device: only one flag is copied to the host, not the values."""

from collections.abc import Sequence

import numpy as np
import warp as wp

from digs_warp.device.contiguous import flat
from digs_warp.device.parallel import ParallelLaunch

wp.set_module_options({"enable_backward": False, "max_unroll": 1, "optimization_level": 3})

# Values that one kernel thread checks.
BLOCK = 4096

_BLOCK = wp.constant(BLOCK)
# Only NaN and infinity have all bits of the exponent set.
_EXPONENT = wp.constant(0x7F800000)


@wp.func
def is_broken(bits: int) -> int:
    """Return 1 for the bits of NaN or infinity, else 0."""
    return wp.where((bits & _EXPONENT) == _EXPONENT, 1, 0)


@wp.kernel
def finite_kernel(
    first: int,
    blocks: wp.array[int],  # [k + 1] first block of each array, and the number of blocks
    addresses: wp.array[wp.uint64],  # [k] where each array begins
    counts: wp.array[int],  # [k] its number of values
    # outputs
    flag: wp.array[int],  # [1] set to 1 where a value is not finite; all threads write the same
):
    """Check one block of one array."""
    block = first + wp.tid()
    which = int(0)
    while block >= blocks[which + 1]:
        which += 1
    begin = (block - blocks[which]) * _BLOCK
    size = wp.min(_BLOCK, counts[which] - begin)
    address = addresses[which] + wp.uint64(4) * wp.uint64(begin)
    bits = wp.array(ptr=address, shape=(size,), dtype=int)
    broken = int(0)
    # Only a loop of fixed length becomes vector code.
    if size == _BLOCK:
        for i in range(_BLOCK):
            broken = broken | is_broken(bits[i])
    else:
        for j in range(size):
            broken = broken | is_broken(bits[j])
    if broken != 0:
        flag[0] = 1


class FiniteCheck:
    """Checks whether any value in a set of arrays is NaN or infinite.

    Args:
        arrays: contiguous floats, or vectors of floats, on one device; their contents may change.
    """

    def __init__(self, arrays: Sequence[wp.array]) -> None:
        device = str(arrays[0].device)
        self._kept_alive = arrays  # the kernel only holds addresses
        counts = [flat(array).shape[0] for array in arrays]
        blocks = np.cumsum([0, *(-(-count // BLOCK) for count in counts)])
        addresses = np.array([array.ptr for array in arrays], dtype=np.uint64)
        self._flag = wp.zeros(1, dtype=int, device=device)
        self._launch = ParallelLaunch(
            finite_kernel,
            int(blocks[-1]),
            [
                wp.array(blocks, dtype=int, device=device),
                wp.array(addresses, dtype=wp.uint64, device=device),
                wp.array(counts, dtype=int, device=device),
                self._flag,
            ],
            device,
            threads=1,  # the sums of a loss are few: waking up others takes longer
        )

    def passes(self) -> bool:
        """Check all arrays; once False, it stays False. Waits for the device and copies four bytes."""
        self._launch.run()
        return int(self._flag.numpy()[0]) == 0


def non_finite_rows(values: np.ndarray) -> np.ndarray:
    """Return the rows of ``values`` (n, ...) that hold NaN or infinity."""
    finite = np.isfinite(values).reshape(len(values), -1).all(axis=1)
    return np.flatnonzero(~finite)
