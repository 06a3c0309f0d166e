"""Choose the parameters of semi-global matching by pairs with known disparity."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

# A pixel is right if its disparity is off by less than this [px].
RIGHT_WITHIN = 1.0


@dataclass(frozen=True)
class MatcherSettings:
    """Parameters of OpenCV's StereoSGBM.

    Attributes:
        block: width of the window [px], odd.
        small_step: penalty of a change by one, per pixel of the window.
        large_step: penalty of a larger change, per pixel of the window.
        uniqueness: by how much the best match must be better than the second best [%].
    """

    block: int = 5
    small_step: int = 8
    large_step: int = 32
    uniqueness: int = 10

    def __str__(self) -> str:
        """The parameters in the order above."""
        return f"{self.block}, {self.small_step}, {self.large_step}, {self.uniqueness}"


@dataclass(frozen=True, eq=False)
class KnownPair:
    """A rectified gray pair with its answer.

    Attributes:
        left: (height, width), uint8.
        right: likewise.
        disparity: of the left image [px], (height, width), NaN where it is not known.
        end: end of the search range, a multiple of 16 [px].
    """

    left: np.ndarray
    right: np.ndarray
    disparity: np.ndarray
    end: int


CANDIDATES = tuple(
    MatcherSettings(block, small, small * factor, uniqueness)
    for block, small, factor, uniqueness in product((3, 5, 7, 9), (2, 8, 24), (2, 4, 8), (0, 5, 10))
)


def wrong_share(settings: MatcherSettings, pair: KnownPair) -> float:
    """Return the share of the pixels with an answer that the matcher gets wrong or leaves open."""
    import cv2

    area = settings.block**2
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=pair.end,
        blockSize=settings.block,
        P1=settings.small_step * area,
        P2=settings.large_step * area,
        disp12MaxDiff=1,
        uniquenessRatio=settings.uniqueness,
        speckleWindowSize=100,
        speckleRange=2,
    )
    found = matcher.compute(pair.left, pair.right).astype(np.float32) / 16
    known = np.isfinite(pair.disparity)
    right = np.abs(found[known] - pair.disparity[known]) < RIGHT_WITHIN
    return 1.0 - float(right.mean())


def tune(pairs: Sequence[KnownPair]) -> MatcherSettings:
    """Return the candidate with the smallest mean share of wrong pixels; the first of equals."""
    means = [np.mean([wrong_share(s, pair) for pair in pairs]) for s in CANDIDATES]
    return CANDIDATES[int(np.argmin(means))]
