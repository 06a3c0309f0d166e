"""Noise of images from one pair: what the two eyes see differently of the same surface.

The right image is moved onto the left one by the true disparity, and slow differences of brightness are
removed. What remains is the noise of both, the right one's smoothed by the interpolation.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.sim.fit.estimate import BLOCKS, UNKNOWN, Estimate, block_numbers
from digs_warp.sim.fit.image_noise import LEVELS, mid_gray_noise
from digs_warp.sim.fit.known_frame import WarpedRays
from digs_warp.sim.fit.known_pair import filled
from digs_warp.sim.fit.plane import OF_MAD
from digs_warp.sim.sensor.filters import box_mean, dilate, gray_of, horizontal_gradient, sampled

# Side of the windows whose mean difference is removed [px].
WINDOW = 9

# The texture is judged on windows of this side, which average the noise [px].
TEXTURE_WINDOW = 7

# The gray level, on windows of this side: that of a pixel itself goes with its noise.
LEVEL_WINDOW = 5

# Differences between the eyes that are no noise, such as texture that interpolation loses, as a share.
MODEL_ERROR = 0.05

# Larger differences, in standard deviations, are reflections and edges.
CLIPPED = 4.0

# Share of the variance of a normal distribution within that many standard deviations.
WITHIN = 0.99887


@dataclass(frozen=True, eq=False)
class Eyes:
    """Two images of a scene with known disparity.

    Attributes:
        left: sRGB, (height, width, 3), uint8.
        right: likewise.
        disparity: true one of the left image [px], (height, width), NaN where unknown.
    """

    left: np.ndarray
    right: np.ndarray
    disparity: np.ndarray


def eye_noise(pairs: Sequence[Eyes], full_well: float, where: np.ndarray | None = None) -> Estimate:
    """Return the noise of a mid-gray pixel [DN]; unknown without pairs.

    Args:
        pairs: of one camera.
        full_well: electrons of a white pixel; one pair hardly tells it.
        where: the part of the image to look at, (height, width), bool; None: all of it.
    """
    sums = sum((_level_sums(pair, where) for pair in pairs), np.zeros((BLOCKS, 2 * LEVELS)))
    if not sums.any():
        return UNKNOWN
    noise = mid_gray_noise(sums, full_well)
    return Estimate(noise.value, float(np.hypot(noise.error, MODEL_ERROR * noise.value)))


def _level_sums(pair: Eyes, where: np.ndarray | None) -> np.ndarray:
    """Return, by block, the summed variance at each gray level, then the number of values."""
    known = np.isfinite(pair.disparity)
    disparity = filled(pair.disparity).astype(np.float32)
    rows, columns = (np.asarray(each) for each in np.indices(disparity.shape))
    source = columns - disparity
    moved = sampled(pair.right.astype(np.float32), source, rows)
    difference = moved - pair.left
    difference -= box_mean(difference, WINDOW)
    seen = known & WarpedRays(disparity).right_visibility() & (source >= WINDOW)
    good = ~dilate(~seen, WINDOW // 2)
    if where is not None:
        good &= where
    good &= _is_plain(pair.left, good)
    variance = 1 + _kept_variance(source) - 1 / WINDOW**2 * 2
    gray = np.rint(box_mean(pair.left, LEVEL_WINDOW)).astype(int)
    return _sums(gray, difference / np.sqrt(variance)[..., None], good)


def _is_plain(image: np.ndarray, among: np.ndarray) -> np.ndarray:
    """Return the half of the pixels with the least texture: errors of the disparity show least there."""
    texture = box_mean(np.abs(horizontal_gradient(gray_of(image))), TEXTURE_WINDOW)
    return texture <= np.median(texture[among]) if among.any() else among


def _kept_variance(source: np.ndarray) -> np.ndarray:
    """Return the share of white noise's variance that the interpolation at these columns keeps."""
    shares = np.arange(33) / 32
    taps = np.arange(-3, 5) - shares[:, None]
    weights = np.sinc(taps) * np.sinc(taps / 4)
    weights /= weights.sum(axis=1, keepdims=True)
    kept = (weights**2).sum(axis=1)
    return kept[np.rint((source % 1) * 32).astype(int)]


def _sums(gray: np.ndarray, difference: np.ndarray, good: np.ndarray) -> np.ndarray:
    values = difference[good]
    if len(values) == 0:
        return np.zeros((BLOCKS, 2 * LEVELS))
    limit = CLIPPED * OF_MAD * np.median(np.abs(values))
    inside = np.abs(values) <= max(limit, 1.0)
    blocks = np.repeat(block_numbers(good.shape)[good][:, None], 3, axis=1)
    index = (blocks * LEVELS + gray[good])[inside]
    squares = np.bincount(index, values[inside] ** 2 / WITHIN, BLOCKS * LEVELS)
    counts = np.bincount(index, minlength=BLOCKS * LEVELS)
    return np.concatenate([x.reshape(BLOCKS, LEVELS) for x in (squares, counts)], axis=1)
