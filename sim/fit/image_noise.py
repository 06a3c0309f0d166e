"""Image noise of a camera: read noise and full well, from frames at rest or from the two eyes of a pair.

In linear light the variance is x / W + r (`digs_warp.sim.sensor.color.image_noise`); in 8-bit steps it is
that times the squared slope of the sRGB curve, plus 1/12 for the rounding.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from digs_warp.data.images import linear_from_srgb
from digs_warp.sim.fit.estimate import BLOCKS, UNKNOWN, Estimate, block_numbers, jackknife
from digs_warp.sim.fit.known_frame import WarpedRays, filled
from digs_warp.sim.fit.plane import OF_MAD
from digs_warp.sim.sensor.color.adaptation import MIDDLE_GREY
from digs_warp.sim.sensor.color.image_noise import STEPS_PER_LINEAR
from digs_warp.sim.sensor.filters import box_mean, dilate, gray_of, horizontal_gradient, sampled

# Errors of the model beside the scatter, as shares: the curvature of sRGB and the rounding to whole steps, as
# far as 1/12 does not describe it, shift simulated recordings by half of this.
MODEL_ERROR, WELL_ERROR = 0.005, 0.02

# Darker and brighter values are clipped now and then, so that their noise looks smaller [DN].
DARKEST, BRIGHTEST = 12, 243

ROUNDING = 1 / 12  # variance of the rounding to whole steps [DN^2]

# Smaller noise between frames, rounding included, does not add to it: most pixels never change [DN].
LEAST = 0.55

# Where noise is that much larger on edges than on plain areas, the camera moved.
MOVED = 1.3

LEVELS = 256


@dataclass(frozen=True)
class ImageNoise:
    """Noise of the images.

    Attributes:
        temporal: mean standard deviation between frames [DN].
        mid_gray: of a mid-gray pixel, without the rounding [DN]: the rig's ``image_noise``.
        full_well: electrons of a white pixel.
        edges: noise where the image changes most over noise where it changes least; 1: at rest.
    """

    temporal: Estimate
    mid_gray: Estimate
    full_well: Estimate
    edges: float

    @property
    def is_hidden(self) -> bool:
        """Whether the rounding to 8 bits hides the noise."""
        return self.temporal.is_known and self.temporal.value < LEAST

    @property
    def is_still(self) -> bool:
        """Whether the camera was at rest."""
        return self.edges <= MOVED


NO_NOISE = ImageNoise(UNKNOWN, UNKNOWN, UNKNOWN, np.nan)


def image_noise(stacks: Sequence[np.ndarray]) -> ImageNoise:
    """Return the noise of images of a camera at rest.

    Differences of successive frames are compared, so that slow changes of the light do not count.

    Args:
        stacks: images of each pose, sRGB, (frames, height, width, 3), uint8; poses with one frame are not
            used.
    """
    stacks = [stack for stack in stacks if len(stack) > 1]
    if not stacks:
        return NO_NOISE
    plain, edges = (np.zeros((BLOCKS, 2 * LEVELS)) for _ in range(2))
    for stack in stacks:
        mean = stack.mean(axis=0)
        gradient = np.abs(horizontal_gradient(gray_of(np.rint(mean).astype(np.uint8))))
        steep = gradient > np.median(gradient)
        plain += _level_sums(stack, mean, ~steep)
        edges += _level_sums(stack, mean, steep)
    # Half of the image is plain enough that a shake of the camera hardly shows.
    return ImageNoise(
        temporal=jackknife(plain, lambda s: s[:LEVELS].sum() / s[LEVELS:].sum()).root(),
        mid_gray=_with_model(jackknife(plain, _mid_gray_variance).root(), MODEL_ERROR),
        full_well=_full_well(plain),
        edges=_edge_ratio(plain.sum(axis=0), edges.sum(axis=0)),
    )


def mid_gray_noise(sums: np.ndarray, full_well: float) -> Estimate:
    """Return the noise of a mid-gray pixel [DN] where the noise at other levels does not tell the full well.

    Args:
        sums: by block, the summed variance at each gray level, then the number of values.
        full_well: electrons of a white pixel, which gives the shot noise, up to all of the noise.
    """
    linear, slope = _linear_and_slope()
    most = STEPS_PER_LINEAR**2 * MIDDLE_GREY / full_well

    def variance(total: np.ndarray) -> float:
        counts = total[LEVELS:]
        measured = total[:LEVELS].sum() / counts.sum() - ROUNDING
        # Variance at each level over that at mid-gray, of either kind of noise.
        read = (slope**2 * counts).sum() / counts.sum() / STEPS_PER_LINEAR**2
        shot = (slope**2 * linear * counts).sum() / counts.sum() / STEPS_PER_LINEAR**2 / MIDDLE_GREY
        if measured <= most * shot:
            return measured / shot
        return most + (measured - most * shot) / read

    return jackknife(sums, variance).root()


def _level_sums(stack: np.ndarray, mean: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Return, by block, the summed variance at each gray level, then the number of values."""
    blocks = block_numbers(stack.shape[1:3])[where]
    index = (blocks[:, None] * LEVELS + np.rint(mean[where]).astype(int)).ravel()
    variances, counts = (np.zeros(BLOCKS * LEVELS) for _ in range(2))
    for first, second in pairwise(stack):
        change = first[where].astype(np.float64) - second[where]
        change -= change.mean(axis=0)
        variances += np.bincount(index, (0.5 * change**2).ravel(), BLOCKS * LEVELS)
        counts += np.bincount(index, minlength=BLOCKS * LEVELS)
    return np.concatenate([x.reshape(BLOCKS, LEVELS) for x in (variances, counts)], axis=1)


def _edge_ratio(plain: np.ndarray, edges: np.ndarray) -> float:
    """Return the ratio of noise at the same gray levels on edges and on plain areas."""
    weight = np.minimum(plain[LEVELS:], edges[LEVELS:])
    with np.errstate(divide="ignore", invalid="ignore"):
        means = [np.nan_to_num(x[:LEVELS] / x[LEVELS:]) for x in (plain, edges)]
    at_plain, at_edges = (float((mean * weight).sum()) for mean in means)
    return float(np.sqrt(at_edges / at_plain)) if at_plain > 0 else np.nan


def _mid_gray_variance(sums: np.ndarray) -> float:
    shot, read = _shot_and_read(sums)
    return STEPS_PER_LINEAR**2 * (shot * MIDDLE_GREY + read)


def _full_well(sums: np.ndarray) -> Estimate:
    shot = jackknife(sums, lambda s: _shot_and_read(s)[0])
    if not shot.value > 0:
        return UNKNOWN
    return _with_model(Estimate(1 / shot.value, shot.error / shot.value**2), WELL_ERROR)


def _with_model(estimate: Estimate, share: float) -> Estimate:
    return Estimate(estimate.value, float(np.hypot(estimate.error, share * estimate.value)))


def _shot_and_read(sums: np.ndarray) -> np.ndarray:
    """Return variance of shot noise at white and of read noise, in linear light, by a weighted fit."""
    from scipy.optimize import nnls

    levels = np.arange(DARKEST, BRIGHTEST)
    counts = sums[LEVELS:][levels]
    levels, counts = levels[counts > 0], counts[counts > 0]
    if len(levels) < 2:
        return np.full(2, np.nan)
    measured = np.maximum(sums[levels] / counts - ROUNDING, 0.0)
    linear, slope = _linear_and_slope()
    terms = np.stack([linear[levels], np.ones(len(levels))], axis=1) * slope[levels, None] ** 2
    found, expected = np.zeros(2), np.full(len(levels), max(measured.mean(), 1e-6))
    # The spread of a variance is proportional to it, which the fit itself tells.
    for _ in range(4):
        weight = np.sqrt(counts) / (expected + ROUNDING)
        found = nnls(terms * weight[:, None], measured * weight)[0]
        expected = terms @ found
    return found


@cache
def _linear_and_slope() -> tuple[np.ndarray, np.ndarray]:
    """Return the linear light of each gray level, and 8-bit steps per unit of linear light there."""
    linear = linear_from_srgb(np.arange(LEVELS) / 255.0)
    return linear, 1 / np.gradient(linear)


# Side of the windows whose mean difference is removed [px].
WINDOW = 9

# The texture is judged on windows of this side, which average the noise [px].
TEXTURE_WINDOW = 7

# The gray level, on windows of this side: that of a pixel itself goes with its noise.
LEVEL_WINDOW = 5

# Differences between the eyes that are no noise, such as texture that interpolation loses, as a share.
EYE_MODEL_ERROR = 0.05

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

    The right image is warped to the left one by the true disparity and slow brightness differences are
    removed; what remains is the noise of both, the right one's smoothed by the interpolation.

    Args:
        pairs: of one camera.
        full_well: electrons of a white pixel; one pair hardly tells it.
        where: the part of the image to look at, (height, width), bool; None: all of it.
    """
    sums = sum((_eye_level_sums(pair, where) for pair in pairs), np.zeros((BLOCKS, 2 * LEVELS)))
    if not sums.any():
        return UNKNOWN
    noise = mid_gray_noise(sums, full_well)
    return Estimate(noise.value, float(np.hypot(noise.error, EYE_MODEL_ERROR * noise.value)))


def _eye_level_sums(pair: Eyes, where: np.ndarray | None) -> np.ndarray:
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
