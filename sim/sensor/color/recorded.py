"""The two images as the camera records them: the rendered images after the effects on them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.color.adaptation import NOT_ADAPTED, Adaptation
from digs_warp.sim.sensor.color.auto_exposure import AutoExposure
from digs_warp.sim.sensor.color.encoding import decode, encode
from digs_warp.sim.sensor.color.protocol import EyeImages, PixelEffect
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.tiers import effect_rng


def recorded_images(
    truth: FrameTruth,
    effects: Sequence[PixelEffect],
    seed: int = 0,
    strength: float = 1.0,
    adaptation: Adaptation = NOT_ADAPTED,
    is_gray: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Return left and right image, sRGB, (height, width, 3), uint8; unchanged if there are no effects.

    Args:
        truth: of the frame.
        effects: in the order in which they act.
        seed: of the recording, >= 0.
        strength: factor on all effects, >= 0.
        adaptation: what exposure and white balance are set to at this moment, at strength 1.
        is_gray: infrared eyes, whose channels are equal: the result is one, (height, width).
    """
    if is_gray:
        left, right = (np.ascontiguousarray(eye[..., :1]) for eye in (truth.image, truth.right))
        truth = replace(truth, image=left, right=right)
        left, right = recorded_images(truth, effects, seed, strength, adaptation)
        return left[..., 0], right[..., 0]
    if not effects or strength == 0:
        return truth.image, truth.right
    eyes = _eyes(truth, effects, adaptation)
    return after_effects(eyes, effects, truth.rig, seed, truth.number, strength)


def after_effects(
    eyes: EyeImages,
    effects: Sequence[PixelEffect],
    rig: StereoRig,
    seed: int = 0,
    number: int = 0,
    strength: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the two images after the effects, sRGB, in the shape of those of the eyes, uint8.

    Args:
        eyes: the light on the two sensors.
        effects: in the order in which they act.
        rig: the camera.
        seed: of the recording, >= 0.
        number: of the frame, >= 0.
        strength: factor on all effects, >= 0.
    """
    for effect in effects:
        rng = effect_rng(seed, number, effect.name)
        eyes = effect.apply(eyes, rig, rng, strength)
    return encode(eyes.left), encode(eyes.right)


def _eyes(truth: FrameTruth, effects: Sequence[PixelEffect], adaptation: Adaptation) -> EyeImages:
    """Return the light on the two sensors; above white, too, if the exposure is still to be chosen."""
    eyes = EyeImages(truth.rig.intrinsics, decode(truth.image), decode(truth.right), adaptation)
    left, right = truth.highlights, truth.right_highlights
    exposes = any(isinstance(effect, AutoExposure) for effect in effects)
    if not exposes or left is None or right is None:
        return eyes
    bright = eyes.with_images(left.restored(eyes.left), right.restored(eyes.right))
    return replace(bright, is_clipped=False)
