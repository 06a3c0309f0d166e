"""Errors of a depth camera added to recorded frames: those that need no scene, only the frame and the camera.

Noise, the static field and steps act on the disparity of the recorded depth; pixels that have no depth get
none. Effects that need the scene (its surfaces, its light above white, views in between) are not here.
"""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.color import AUTO_EXPOSURE, LENS_BLUR, PIXEL_EFFECTS, WHITE_BALANCE
from digs_warp.sim.sensor.color.encoding import decode
from digs_warp.sim.sensor.color.protocol import EyeImages
from digs_warp.sim.sensor.color.recorded import after_effects
from digs_warp.sim.sensor.effects.disparity_errors import Quantum, StaticField
from digs_warp.sim.sensor.facts import STEP
from digs_warp.sim.sensor.frame import Cause, Sensed
from digs_warp.sim.sensor.law import ROUNDING, sense_depth, within_range
from digs_warp.sim.sensor.steps import near_steps
from digs_warp.sim.sensor.tiers import apply_effects

# What matching two images does by itself in a simulated scene: the noise of the tier "law", and no
# depth where the window of the search lies across a depth step.
DISPARITY_NOISE, STEP_HOLES = "disparity-noise", "step-holes"

# Exposure and white balance follow light above white, which a recording has lost; a lens has blurred it.
_NOT_HERE = (LENS_BLUR, AUTO_EXPOSURE, WHITE_BALANCE)
_ON_IMAGES = tuple(each for each in PIXEL_EFFECTS if each not in _NOT_HERE)

EFFECTS_ON_RECORDINGS = (
    DISPARITY_NOISE,
    StaticField.name,
    Quantum.name,
    STEP_HOLES,
    *(effect.name for effect in _ON_IMAGES),
)


def worse_depth(
    depth: np.ndarray,
    rig: StereoRig,
    names: Collection[str],
    seed: int = 0,
    number: int = 0,
    strength: float = 1.0,
) -> np.ndarray:
    """Return recorded depth after the named effects, planar z [m], (height, width), float32, NaN: unknown.

    Pixels without depth stay without; others lose it at depth steps, and where noise moves them out of the
    range. The range is that of the rig, or of the recorded depth where that reaches further.

    Args:
        depth: as recorded, planar z [m], (height, width), float32, NaN where unknown.
        rig: the eyes that measured it, at the size of the depth image.
        names: out of `EFFECTS_ON_RECORDINGS`; those on images change nothing here.
        seed: of all random numbers, >= 0.
        number: of the frame, >= 0.
        strength: factor on all effects, and on how far from a depth step there is no depth, >= 0; 0: none.
    """
    if strength == 0 or not np.isfinite(depth).any():
        return depth
    focal_baseline = np.float32(rig.focal_baseline)
    recorded = focal_baseline / depth
    disparity = recorded
    if DISPARITY_NOISE in names:
        noisy = sense_depth(depth, replace(rig, disparity_step=0.0), seed, number, strength)
        disparity = focal_baseline / noisy
    untouched = np.zeros(depth.shape, np.uint8), np.ones(depth.shape, np.float32)
    sensed = Sensed(disparity, *untouched)
    sensed = apply_effects(sensed, rig, names, seed, number, strength)
    reach = round(strength * (rig.window // 2))  # half a window to either side of the step
    if STEP_HOLES in names and reach > 0:
        sensed = sensed.with_holes(near_steps(recorded, STEP, reach), Cause.EDGE)
    sensed = within_range(sensed, _reaching(rig, depth))
    worse = focal_baseline / sensed.disparity
    np.copyto(worse, depth, where=sensed.disparity == recorded)
    return worse


def worse_images(
    left: np.ndarray,
    right: np.ndarray,
    rig: StereoRig,
    names: Collection[str],
    seed: int = 0,
    number: int = 0,
    strength: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Return two recorded images after the named effects, both (height, width, 3), uint8, sRGB.

    Args:
        left: as recorded; (height, width, 1) of an infrared eye.
        right: the same of the other eye.
        rig: the camera that took them, at their size.
        names: out of `EFFECTS_ON_RECORDINGS`; those on depth change nothing here.
        seed: of all random numbers, >= 0.
        number: of the frame, >= 0.
        strength: factor on all effects, >= 0; 0: none.
    """
    effects = [effect for effect in _ON_IMAGES if effect.name in names]
    if strength == 0 or not effects:
        return left, right
    eyes = EyeImages(rig.intrinsics, decode(left), decode(right))
    return after_effects(eyes, effects, rig, seed, number, strength)


def _reaching(rig: StereoRig, depth: np.ndarray) -> StereoRig:
    """Return the rig with a range that holds all recorded depths."""
    nearest, farthest = float(np.nanmin(depth)), float(np.nanmax(depth))
    return replace(
        rig,
        min_depth=min(rig.min_depth, nearest * (1 - ROUNDING)),
        max_depth=max(rig.max_depth, farthest),
        max_disparity=0.0,
    )
