"""Changes of the exposure: how much brighter one frame shows the points that another one shows, too."""

from collections.abc import Mapping, Sequence

import numpy as np

from digs_warp.check.agreement import COARSE, ENOUGH, reproject
from digs_warp.check.small_frames import SmallFrame

# Darker and brighter pixels [of 255] are left out: noise and the end of the range change their ratio.
DARKEST, BRIGHTEST = 20, 235

# Photographs store about the 2.2th root of the light.
GAMMA = 2.2


def exposure_change(
    frames: Mapping[int, SmallFrame], pairs: Sequence[tuple[int, int]]
) -> float | None:
    """Return the median change of the exposure between the frames of a pair [stops]; None: not known."""
    gains = [
        abs(np.log2(found))
        for first, second in pairs
        if (found := brightness_ratio(frames[first], frames[second])) is not None
    ]
    return float(GAMMA * np.median(gains)) if gains else None


def brightness_ratio(first: SmallFrame, second: SmallFrame) -> float | None:
    """Return how many times brighter the second frame shows the points that both see; None: too few."""
    nearer, here, there, _ = reproject(first, second)
    fair = (np.abs(nearer) < COARSE) & _is_fair(here) & _is_fair(there)
    if fair.sum() < ENOUGH:
        return None
    return float(np.median(there[fair] / here[fair]))


def _is_fair(brightness: np.ndarray) -> np.ndarray:
    return (brightness > DARKEST) & (brightness < BRIGHTEST)
