"""Which frames of a film are taken: evenly spaced, and each the sharpest of its neighborhood."""

from itertools import pairwise

import numpy as np

from digs_warp.data.sharpness import REPEATED

# The sharpest frame is sought in this share of each interval, in its middle, so that the distances between
# the chosen frames differ by less than a factor of five.
SOUGHT = 0.67


def choose(sharpness: np.ndarray, count: int) -> list[int]:
    """Return the numbers of at most ``count`` frames, ascending.

    Args:
        sharpness: of each frame of the film, in order; `REPEATED` where it is the same as the one before.
        count: at least 1.
    """
    usable = np.flatnonzero(sharpness != REPEATED)
    if len(usable) <= count:
        return usable.tolist()
    edges = np.linspace(0, len(sharpness), count + 1)
    chosen = []
    for start, end in pairwise(edges):
        margin = (1 - SOUGHT) / 2 * (end - start)
        first = round(start + margin)
        window = sharpness[first : max(round(end - margin), first + 1)]
        if len(window) and window.max() != REPEATED:
            chosen.append(first + int(np.argmax(window)))
    return chosen
