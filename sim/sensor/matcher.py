"""The 'matcher' tier: semi-global matching of the two images, as a real depth camera does it.

Hirschmueller 2008, in OpenCV's implementation (StereoSGBM, five directions), with a left-right check.
"""

import numpy as np

from digs_warp.checks import DigsError, check_shape
from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.blame import blame
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.frame import FrameTruth, Sensed

# Penalties for a change of disparity by one and by more, per pixel of the window: OpenCV's suggestion.
SMALL_STEP, LARGE_STEP = 8, 32

# The best match must cost this much less than the second best [%].
UNIQUENESS = 10

# Left and right disparity may differ by this much [px]; OpenCV takes 0 and -1 for 1 as well.
LEFT_RIGHT = 1

# Islands of fewer pixels, set apart by more than this many pixels of disparity, are dropped.
ISLAND, ISLAND_STEP = 100, 2

# OpenCV reports disparity in sixteenths of a pixel, and searches multiples of sixteen pixels.
FIXED_POINT = 16


def sense_by_matching(
    truth: FrameTruth, recorded: tuple[np.ndarray, np.ndarray] | None = None
) -> Sensed:
    """Return what matching the two images of a frame gives, labelled with the truth at hand.

    Args:
        truth: of the frame.
        recorded: left and right image with all that the camera does to them, sRGB, each
            (height, width, 3), uint8; None: the images of the truth.
    """
    rig = truth.rig
    left, right = map(gray_of, recorded or (truth.image, truth.right))
    disparity = match(left, right, search_range(rig), rig.window)
    with np.errstate(divide="ignore"):
        depth = np.float32(rig.focal_baseline) / disparity
    disparity[~((depth >= rig.min_depth) & (depth <= rig.max_depth))] = np.nan
    confidence = np.where(np.isnan(disparity), np.float32(0), np.float32(1))
    return Sensed(disparity, blame(disparity, truth), confidence)


def search_range(rig: StereoRig) -> int:
    """Return how many disparities a rig has to search to see its nearest depth [px].

    Wider images than this do not exist, so the range ends with the image at the latest.
    """
    nearest = min(rig.largest_disparity, rig.intrinsics.width)
    return FIXED_POINT * max(1, int(np.ceil(nearest / FIXED_POINT)))


def match(left: np.ndarray, right: np.ndarray, disparities: int, window: int = 5) -> np.ndarray:
    """Return the disparity of a rectified pair [px], shape (height, width), float32, NaN: no match.

    Args:
        left: grey image, (height, width), uint8.
        right: of the same size.
        disparities: search 0 to this [px], exclusive; a multiple of 16.
        window: width of the square block, odd.
    """
    import cv2

    check_shape("right image", right, left.shape)
    if disparities < FIXED_POINT or disparities % FIXED_POINT:
        raise DigsError(f"disparities: {disparities}, expected a positive multiple of 16")
    if window < 1 or window % 2 == 0:
        raise DigsError(f"window: {window}, expected an odd number of pixels >= 1")
    # OpenCV gives up the first `disparities` columns, whatever the depth; these are columns to give up.
    # An image narrower than the window is refused; more columns on the right change nothing else.
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
        P1=SMALL_STEP * window * window,
        P2=LARGE_STEP * window * window,
        disp12MaxDiff=LEFT_RIGHT,
        uniquenessRatio=UNIQUENESS,
        speckleWindowSize=ISLAND,
        speckleRange=ISLAND_STEP,
    )
    found = matcher.compute(pair[0], pair[1])[:, disparities : disparities + width]
    return np.where(found < 0, np.nan, found / np.float32(FIXED_POINT)).astype(np.float32)
