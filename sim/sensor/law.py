"""The 'law' tier: depth noise from the geometry of a stereo pair; and the sensor's working range.

A matcher finds the disparity d = f b / Z with an error of sigma_d pixels at any distance, and reports it
in steps. In depth this gives the quadratic law

    sigma_Z = Z^2 sigma_d / (f b)

where f is the focal length [px] and b the baseline [m]. The noise is white: no occlusion holes, no texture
failures.
"""

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.frame import Cause, Sensed

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


# Part of the seed: other effects draw other numbers.
EFFECT_ID = 1


def sense_depth(
    depth_true: np.ndarray, rig: StereoRig, seed: int, frame: int, strength: float = 1.0
) -> np.ndarray:
    """Return the depth that the sensor reports for a true depth image.

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
    if rig.disparity_sigma > 0:
        rng = np.random.default_rng(np.random.SeedSequence([seed, frame, EFFECT_ID]))
        sigma = strength * rig.disparity_sigma
        disparity += sigma * rng.standard_normal(disparity.shape, dtype=np.float32)
    step = strength * rig.disparity_step
    if step > 0:
        disparity = np.round(disparity / step) * step
    with np.errstate(divide="ignore"):
        return (focal_baseline / disparity).astype(np.float32)
