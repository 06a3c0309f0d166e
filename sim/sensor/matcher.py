"""The 'matcher' tier: semi-global matching of the two images, as a real depth camera does it.

Hirschmueller 2008, in OpenCV's implementation (StereoSGBM, five directions), with a left-right check.
"""

import numpy as np

from digs_warp.checks import DigsError, check_shape
from sim.rig import StereoRig
from sim.sensor.blame import blame
from sim.sensor.filters import gray_of
from sim.sensor.frame import FrameTruth, Sensed

# Identifies this tier in the seeds, apart from the effects.
MATCHER_ID = 2

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


def sense_by_matching(truth: FrameTruth, seed: int = 0, strength: float = 1.0) -> Sensed:
    """Return what matching the two images of a frame gives, labelled with the truth at hand.

    Args:
        truth: of the frame.
        seed: of the recording, >= 0; each frame and eye has noise of its own.
        strength: factor on the noise of the images, >= 0.
    """
    rig = truth.rig
    eyes = np.random.SeedSequence([seed, truth.number, MATCHER_ID]).spawn(2)
    left, right = (
        noisy_gray(image, strength * rig.image_noise, np.random.default_rng(eye))
        for image, eye in zip((truth.image, truth.right), eyes, strict=True)
    )
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


def noisy_gray(image: np.ndarray, noise: float, rng: np.random.Generator) -> np.ndarray:
    """Return the brightness of an sRGB image with white noise of ``noise`` DN, uint8."""
    gray = gray_of(image)
    if noise <= 0:
        return gray
    grain = np.float32(noise) * rng.standard_normal(gray.shape, dtype=np.float32)
    return np.clip(np.round(gray + grain), 0, 255).astype(np.uint8)
