"""Which files of a recording were taken at the same moment, where their times are written beside them."""

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.words import counted


def at_the_moments(
    times: np.ndarray, others: np.ndarray, largest_gap: float, source: str, what: str
) -> list[int | None]:
    """Return for each image the number of what was taken at its moment; None: nothing near enough.

    Args:
        times: of the images [s], shape (n,), n >= 1.
        others: of the other files or lines [s], shape (m,), m >= 1.
        largest_gap: what differs by more was not taken at the same moment [s].
        source: where the other times are, for messages.
        what: of the others, one.

    Raises:
        CaptureError: no image has any: two clocks, or the file of another recording.
    """
    nearest = [int(np.argmin(np.abs(others - time))) for time in times]
    gaps = np.abs(times - others[nearest])
    if gaps.min() > largest_gap:
        raise CaptureError(
            f"{source}: none of {counted(len(others), what)} was taken within {1e3 * largest_gap:g} ms of an "
            f"image; the nearest are {float(np.median(gaps)):.3g} s away (median). If they belong to these "
            "images, correct the times in the file"
        )
    return [i if gap <= largest_gap else None for i, gap in zip(nearest, gaps, strict=True)]
