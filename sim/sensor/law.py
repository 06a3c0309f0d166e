"""The 'law' tier: depth noise from the geometry of a stereo pair; and the sensor's working range.

A matcher finds the disparity d = f b / Z with an error of sigma_d pixels at any distance, and reports it
in steps. In depth this gives the quadratic law

    sigma_Z = Z^2 sigma_d / (f b)

where f is the focal length [px] and b the baseline [m]. The errors of devices are not white: neighbors err
alike, and most of the error stays from frame to frame. So the noise is a sum of two fields of octaves, one
drawn for each frame and one for the whole recording, to which an error in proportion to d belongs. The latter
moves with d, as dots and texture do: at another distance a pixel errs otherwise. Where the rig says how much
of a surface has no depth, holes are where another such field is largest, and in the shadows beside near
things. No texture is looked at.
"""

from functools import lru_cache

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.frame import Cause, Sensed
from digs_warp.sim.sensor.noise_field import octave_normal
from digs_warp.sim.sensor.right_eye import HIDDEN, classify

# A depth right at the end is in range, however it is rounded.
ROUNDING = 5e-7


def within_range(sensed: Sensed, rig: StereoRig) -> Sensed:
    """Return the frame with holes where the sensed depth is out of range, labeled too near or too far.

    Disparities of 0 and below, which noise makes of small ones, are too far.
    """
    smallest = rig.focal_baseline / rig.max_depth
    sensed = sensed.with_holes(sensed.disparity > np.float32(rig.largest_disparity), Cause.NEAR)
    return sensed.with_holes(sensed.disparity < np.float32(smallest * (1 - ROUNDING)), Cause.FAR)


def round_into_range(depth: np.ndarray, rig: StereoRig) -> None:
    """Move depths that only rounding put past an end of the range to that end, in place."""
    for end, past in (
        (rig.max_depth, depth > rig.max_depth),
        (rig.min_depth, depth < rig.min_depth),
    ):
        depth[past & (np.abs(depth - end) < 2 * ROUNDING * end)] = end


# Parts of the seed: each draws other numbers.
CHANGING, STAYING, HOLES = 1, 2, 3

# Of the field whose largest values are holes: correlation of its coarsest octave [px], and the share of its
# variance that stays from frame to frame [tuned: number and sizes of the holes of a D435].
HOLE_CORRELATION = 8.0
HOLES_STAY = 0.8

# What stays moves with the surface by up to so many pixels: beyond, all disparities have the same.
FARTHEST = 256


def sense_depth(
    depth_true: np.ndarray, rig: StereoRig, seed: int, frame: int, strength: float = 1.0
) -> np.ndarray:
    """Return the depth that the sensor reports for a true depth image, without holes.

    Args:
        depth_true: planar depth [m], shape (height, width), NaN where there is nothing.
        rig: focal length, baseline, noise and step.
        seed: of the recording, >= 0.
        frame: number of the frame, >= 0; frames may be sensed in any order.
        strength: factor on noise and step, >= 0.

    Returns:
        Planar depth [m], float32, at any distance; infinite or negative where noise makes the disparity
        zero or negative.
    """
    check_shape("depth_true", depth_true, (rig.intrinsics.height, rig.intrinsics.width))
    focal_baseline = rig.intrinsics.fx * rig.baseline
    # float64: without noise and steps, converting to disparity and back gives the same float32.
    disparity = focal_baseline / depth_true.astype(np.float64)
    staying = np.sqrt(1 - rig.temporal_share) * rig.disparity_sigma
    shape, correlation = disparity.shape, rig.disparity_correlation
    if staying > 0 or rig.disparity_distortion > 0:
        field = moved_with(lasting_field(seed, STAYING, shape, correlation), disparity)
        disparity *= 1 + np.float32(strength * rig.disparity_distortion) * field
        disparity += np.float32(strength * staying) * field
    if rig.changing_sigma > 0:
        field = _field([seed, frame, CHANGING], shape, correlation)
        disparity += np.float32(strength * rig.changing_sigma) * field
    step = strength * rig.disparity_step
    if step > 0:
        disparity = np.round(disparity / step) * step
    with np.errstate(divide="ignore"):
        return (focal_baseline / disparity).astype(np.float32)


def with_holes(
    sensed: Sensed, true: np.ndarray, rig: StereoRig, seed: int, frame: int, strength: float = 1.0
) -> Sensed:
    """Return the frame without depth where devices have none; as it is if the rig's ``hole_share`` is 0.

    Args:
        sensed: the measurement.
        true: disparity [px], (height, width), float32, NaN where there is nothing.
        rig: the camera.
        seed: of the recording, >= 0.
        frame: number of the frame, >= 0.
        strength: factor on the share, >= 0; 0: no shadows either.
    """
    share = min(strength * rig.hole_share, 1.0)
    if share == 0:
        return sensed
    state = classify(true, true, np.ones(true.shape, bool))
    sensed = sensed.with_holes(state == HIDDEN, Cause.OCCLUDED)
    field = moved_with(lasting_field(seed, HOLES, true.shape, HOLE_CORRELATION), true)
    field *= np.float32(np.sqrt(HOLES_STAY))
    changing = _field([seed, frame, HOLES], true.shape, HOLE_CORRELATION)
    field += np.float32(np.sqrt(1 - HOLES_STAY)) * changing
    return sensed.with_holes(field > _quantile(1 - share), Cause.RANDOM)


def _quantile(share: float) -> np.float32:
    """Return the value that so large a share of a normal distribution lies below."""
    from scipy.special import ndtri

    return np.float32(ndtri(share))


@lru_cache(maxsize=4)
def lasting_field(seed: int, part: int, shape: tuple[int, int], correlation: float) -> np.ndarray:
    """Return a field for `moved_with` that all frames of a recording share: do not write to it."""
    return _field([seed, part], (shape[0], shape[1] + FARTHEST), correlation)


def moved_with(field: np.ndarray, disparity: np.ndarray) -> np.ndarray:
    """Return the values of a field as far to the right of each pixel as its disparity [px]."""
    height, width = disparity.shape
    at = np.zeros((height, width), np.int32)
    with np.errstate(invalid="ignore"):
        np.copyto(at, np.clip(disparity, 0, FARTHEST - 1), casting="unsafe", where=disparity > 0)
    at += np.arange(width, dtype=np.int32)
    at += np.arange(height, dtype=np.int32)[:, None] * np.int32(width + FARTHEST)
    return field.reshape(-1)[at]


def _field(seeds: list[int], shape: tuple[int, int], correlation: float) -> np.ndarray:
    """Return noise of variance 1, (height, width), float32."""
    rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence(seeds)))
    return octave_normal(rng, shape, correlation)
