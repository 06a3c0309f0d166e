"""The tiers of the depth sensor: from perfect depth to real matching of two images."""

import zlib
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import get_args

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.config import Tier
from digs_warp.sim.sensor.effects import AFTER_MATCHING
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.error_attribution import attribute_errors
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.frame import Cause, FrameTruth, Sensed
from digs_warp.sim.sensor.law import round_into_range, sense_depth, with_holes, within_range


def sense(
    truth: FrameTruth,
    tier: Tier,
    plan: Sequence[Choice] = (),
    seed: int = 0,
    strength: float = 1.0,
    recorded: tuple[np.ndarray, np.ndarray] | None = None,
) -> Sensed:
    """Return the sensor's measurement of a frame, within the range of the camera in every tier.

    The same arguments give the same bytes, whatever was sensed before.

    Args:
        truth: of the frame.
        tier: "truth": perfect; "law": the closed-form law of stereo; "guided": matching of the two recorded
            images near the true disparity, then the effects that no image shows; "matcher": the same with
            matching over the full range.
        plan: for the tiers that match.
        seed: of the recording, >= 0.
        strength: factor on all effects, >= 0; 0 is the truth within the range.
        recorded: left and right image as the camera records them, for the tiers that match them; None: the
            images of the truth, without noise.

    Raises:
        DigsError: an unknown tier.
    """
    if tier not in get_args(Tier):
        raise DigsError(f"tier '{tier}': expected {', '.join(get_args(Tier))}")
    names = {choice.effect for choice in plan if choice.on}
    if tier == "truth" or strength == 0:
        sensed = Sensed.of(truth)
    elif tier == "law":
        sensed = _sense_law(truth, seed, strength)
    else:
        from digs_warp.sim.sensor.guided.tier import sense_by_guided_matching

        if tier == "matcher":
            matched = sense_by_matching(truth, recorded)
        else:
            matched = sense_by_guided_matching(truth, recorded, names)
        sensed = apply_effects(matched, truth.rig, names, seed, truth.number, strength)
    return within_range(sensed, truth.rig)


def sense_by_matching(
    truth: FrameTruth, recorded: tuple[np.ndarray, np.ndarray] | None = None
) -> Sensed:
    """Match the two images of a frame; the labels come from the truth.

    Args:
        truth: of the frame.
        recorded: left and right image after the effects on images, sRGB, each (height, width, 3),
            uint8; None: the images of the truth.
    """
    from digs_warp.sim.sensor.guided.confidence import confidence_in_matches
    from digs_warp.sim.sensor.matcher import match, search_range

    rig = truth.rig
    left, right = map(gray_of, recorded or (truth.image, truth.right))
    disparities = search_range(rig)
    matched = match(left, right, disparities, rig.window, smoothness=rig.smoothness)
    # OpenCV keeps its costs to itself: confidence computes them again.
    confidence = confidence_in_matches(left, right, matched, disparities, rig.window)
    disparity = truth.drift.reported_disparity(matched)
    return Sensed(disparity, attribute_errors(disparity, truth), confidence)


def apply_effects(
    matched: Sensed,
    rig: StereoRig,
    names: Collection[str],
    seed: int = 0,
    number: int = 0,
    strength: float = 1.0,
) -> Sensed:
    """Return what was matched after the named effects that act on it, in their physical order.

    Args:
        matched: what the search found.
        rig: the camera.
        names: of effects; those that do not act on matched depth change nothing here.
        seed: of the recording, >= 0.
        number: of the frame, >= 0.
        strength: factor on the effects, >= 0.
    """
    for effect in AFTER_MATCHING:
        if effect.name in names:
            rng = effect_rng(seed, number, effect.name)
            matched = effect.apply(matched, rig, rng, strength)
    return matched


def effect_rng(seed: int, frame: int, name: str) -> np.random.Generator:
    """Return the random generator of one effect on one frame; no other effect or frame shares it."""
    sequence = np.random.SeedSequence([seed, frame, zlib.crc32(name.encode())])
    # Twice as fast as the default, with the same statistical quality.
    return np.random.Generator(np.random.SFC64(sequence))


def depth_of(sensed: Sensed, truth: FrameTruth) -> np.ndarray:
    """Return planar depth [m], (height, width), float32, coded as a ZED does.

    NaN: nothing was matched; -inf: too near; +inf: too far. Where disparity equals
    the truth to the bit, so does depth. No rounding leaves the range of the camera.
    """
    with np.errstate(divide="ignore"):
        depth = np.float32(truth.rig.focal_baseline) / sensed.disparity
    np.copyto(depth, truth.depth, where=sensed.disparity == truth.disparity)
    round_into_range(depth, truth.rig)
    code_missing(depth, sensed.cause)
    return depth


def code_missing(depth: np.ndarray, cause: np.ndarray) -> None:
    """Say in place why depth is missing: -inf too near, +inf too far, else NaN; both (height, width)."""
    missing = np.isnan(depth)
    np.copyto(depth, np.float32(-np.inf), where=missing & (cause == Cause.NEAR))
    np.copyto(depth, np.float32(np.inf), where=missing & (cause == Cause.FAR))


def _sense_law(truth: FrameTruth, seed: int, strength: float) -> Sensed:
    depth = sense_depth(truth.depth, truth.rig, seed, truth.number, strength)
    sensed = replace(Sensed.of(truth), disparity=np.float32(truth.rig.focal_baseline) / depth)
    return with_holes(sensed, truth.disparity, truth.rig, seed, truth.number, strength)
