"""Numbers of a view or a step that kernels read from small arrays on the device."""

import numpy as np
import warp as wp


def put(array: wp.array, values: np.ndarray | tuple[float, ...]) -> None:
    """Set all values of a contiguous array.

    On a CPU they are written where they are: the arrays that `wp.array.assign` makes on the way take five
    times as long, and a step of the training sets a dozen.
    """
    if str(array.device) == "cpu":
        array.numpy()[...] = values
    else:
        array.assign(np.asarray(values))
