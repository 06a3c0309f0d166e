"""The 'matcher' tier: semi-global matching of the two images, as in a real depth camera.

Hirschmueller 2008, OpenCV's implementation (StereoSGBM, five directions) with a left-right check.
"""

import numpy as np

from digs_warp.checks import DigsError, check_shape
from digs_warp.sim.camera.rig import StereoRig

# Penalties for disparity changes of one and of more, per pixel of the window: OpenCV's suggestion.
SMALL_STEP, LARGE_STEP = 8, 32

# The best match must cost this much less than the second best [%].
UNIQUENESS = 10

# Largest difference between left and right disparity [px]; OpenCV treats 0 and -1 as 1.
LEFT_RIGHT = 1

# Islands of fewer pixels whose disparity differs by more than this many pixels are dropped.
ISLAND, ISLAND_STEP = 100, 2

# OpenCV reports disparity in sixteenths of a pixel and searches multiples of sixteen pixels.
FIXED_POINT = 16


def search_range(rig: StereoRig) -> int:
    """Return how many disparities a rig has to search to find its nearest depth, at most the width [px]."""
    nearest = min(rig.largest_disparity, rig.intrinsics.width)
    return FIXED_POINT * max(1, int(np.ceil(nearest / FIXED_POINT)))


def match(
    left: np.ndarray,
    right: np.ndarray,
    disparities: int,
    window: int = 5,
    checks: bool = True,
    uniqueness: int = UNIQUENESS,
    smoothness: float = 1.0,
) -> np.ndarray:
    """Return the disparity of a rectified pair [px], shape (height, width), float32, NaN: no match.

    Args:
        left: gray image, (height, width), uint8.
        right: of the same size.
        disparities: end of the search range, which begins at 0 [px], exclusive; a multiple of 16.
        window: width of the square block, odd.
        checks: whether to drop matches that are not unique, differ between the eyes, or are islands.
        uniqueness: by how much the best match must be better than the second best [%], 0 to 100.
        smoothness: factor on the penalties.
    """
    import cv2

    check_shape("right image", right, left.shape)
    if disparities < FIXED_POINT or disparities % FIXED_POINT:
        raise DigsError(f"disparities: {disparities}, expected a positive multiple of 16")
    if window < 1 or window % 2 == 0:
        raise DigsError(f"window: {window}, expected an odd number of pixels >= 1")
    # OpenCV drops the first `disparities` columns, whatever the depth: the padding gives it columns to drop.
    # It rejects images narrower than the window; extra columns on the right change nothing else.
    width = left.shape[1]
    missing = max(0, window - width)
    pair = [
        cv2.copyMakeBorder(image, 0, 0, disparities, missing, cv2.BORDER_CONSTANT)
        for image in (left, right)
    ]
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=disparities,
        blockSize=window,
        P1=round(smoothness * SMALL_STEP * window * window),
        P2=round(smoothness * LARGE_STEP * window * window),
        # OpenCV takes 0 and less for 1; nothing differs by more than the range.
        disp12MaxDiff=LEFT_RIGHT if checks else disparities,
        uniquenessRatio=uniqueness if checks else 0,
        speckleWindowSize=ISLAND if checks else 0,
        speckleRange=ISLAND_STEP,
    )
    found = matcher.compute(pair[0], pair[1])[:, disparities : disparities + width]
    return np.where(found < 0, np.nan, found / np.float32(FIXED_POINT)).astype(np.float32)
