"""PFM, the float images of stereo data sets: a header of three lines, then rows from bottom to top.

See https://netpbm.sourceforge.net/doc/pfm.html. A negative scale says that the numbers are little-endian.
"""

from pathlib import Path

import numpy as np

from digs_warp.record.files import write_atomically

KINDS = {1: "Pf", 3: "PF"}


def write_pfm(path: Path, values: np.ndarray) -> None:
    """Write an image of one or three channels.

    Args:
        path: the file.
        values: shape (height, width) or (height, width, 3), float32.
    """
    image = values.reshape(*values.shape[:2], -1)
    height, width, channels = image.shape
    header = f"{KINDS[channels]}\n{width} {height}\n-1.0\n"
    write_atomically(path, header.encode() + image[::-1].astype("<f4").tobytes())
