"""What the planner knows about a scene: statistics of rendered frames, before any matching."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.materials import (
    highlights_on,
    is_glossy,
    is_mirror,
    is_transparent,
    pixels_of,
)
from digs_warp.sim.sensor.motion import image_motion
from digs_warp.sim.sensor.slopes import width_ratio
from digs_warp.sim.sensor.steps import find_steps, near_steps
from digs_warp.sim.sensor.virtual_image import virtual_disparity

# Thresholds of the statistics; the effects that use them give the sources.
TEXTURE_REACH = 20.0  # [px]
WEAK_SNR = 0.5
STEP, LARGE_STEP = 1.0, 3.0  # [px]
STEP_REACH = 2  # [px]
GRAZING_RATIO = 0.4
SATURATED, DARK = 250, 15  # [DN]

# Motion is smooth over the image: every eighth pixel along each axis is enough.
MOTION_STRIDE = 8

PERCENTILE = 95


@dataclass(frozen=True, kw_only=True)
class SceneFacts:
    """Statistics of one or more frames; shares are of the pixels that show something, 0 to 1.

    The effects that use the thresholds give their sources.
    """

    frames: int
    min_depth: float  # [m]
    max_depth: float  # [m]
    min_disparity: float  # [px]
    max_disparity: float  # [px]
    texture_rms: float  # RMS horizontal gradient of the left image [DN/px]
    textureless_share: float  # share farther than 20 px from texture
    textureless_radius: float  # largest distance to texture [px]
    weak_texture_share: float  # share with gradient / image noise < 0.5
    step_share: float  # share within 2 px of a disparity step >= 1 px
    large_step_share: float  # share within 2 px of a disparity step > 3 px
    step_contrast: float  # median ln(foreground texture / background texture) across steps
    occluded_share: float  # share hidden from the right eye, estimated from disparity
    grazing_share: float  # share with |ln(1 - dd/dx)| >= 0.4
    specular_share: float  # share with roughness < 0.3, without mirrors
    highlight_shift: float  # 95th percentile of the highlight's disparity error there [px]
    mirror_share: float  # share with metallic > 0.5 and roughness < 0.1
    transparent_share: float  # share of transparent materials
    saturated_share: float  # share above 250 of 255
    dark_share: float  # share below 15 of 255
    blur_px: float  # 95th percentile of the motion during the exposure [px]
    skew_px: float  # 95th percentile of the motion during the shutter's read-out [px]


# Extremes over the frames; every other fact is the mean over the frames where it can be measured.
_SMALLEST = ("min_depth", "min_disparity")
_LARGEST = ("max_depth", "max_disparity", "textureless_radius", "highlight_shift")


def measure_facts(frames: Sequence[FrameTruth]) -> SceneFacts:
    """Return the facts of a scene from some of its frames.

    Facts that cannot be measured (no step, nothing in view) are 0, except depths and disparities, which
    are NaN when nothing is in view.

    Raises:
        DigsError: no frames.
    """
    if not frames:
        raise DigsError("facts: no frames, expected at least one")
    measured = [_measure(frame) for frame in frames]
    facts: dict[str, float] = {}
    for name in (field.name for field in fields(SceneFacts) if field.name != "frames"):
        values = np.array([m[name] for m in measured if name in m and np.isfinite(m[name])])
        if len(values) == 0:
            facts[name] = np.nan if name in _SMALLEST + _LARGEST[:2] else 0.0
        elif name in _SMALLEST:
            facts[name] = float(values.min())
        elif name in _LARGEST:
            facts[name] = float(values.max())
        else:
            facts[name] = float(values.mean())
    return SceneFacts(frames=len(frames), **facts)


def _measure(truth: FrameTruth) -> dict[str, float]:
    """Return the facts of one frame; a fact that cannot be measured is left out."""
    visible = np.isfinite(truth.depth)
    if not visible.any():
        return {}
    depth = truth.depth[visible]
    return {
        "min_depth": float(depth.min()),
        "max_depth": float(depth.max()),
        "min_disparity": truth.rig.focal_baseline / float(depth.max()),
        "max_disparity": truth.rig.focal_baseline / float(depth.min()),
        **_texture(truth, visible),
        **_steps(truth, visible),
        **_surfaces(truth, visible),
        **_motion(truth),
    }


def _texture(truth: FrameTruth, visible: np.ndarray) -> dict[str, float]:
    distance = truth.texture_distance[visible]
    gray = truth.gray[visible]
    # Without any texture the distance is infinite: the diagonal of the image limits it.
    radius = min(float(distance.max()), float(np.hypot(*truth.depth.shape)))
    return {
        "texture_rms": float(np.sqrt(np.mean(np.square(truth.gradient[visible])))),
        "textureless_share": float(np.mean(distance > TEXTURE_REACH)),
        "textureless_radius": radius,
        "weak_texture_share": float(np.mean(truth.texture_snr[visible] < WEAK_SNR)),
        "saturated_share": float(np.mean(gray > SATURATED)),
        "dark_share": float(np.mean(gray < DARK)),
    }


def _steps(truth: FrameTruth, visible: np.ndarray) -> dict[str, float]:
    disparity = truth.disparity
    facts = {
        "step_share": float(np.mean(near_steps(disparity, STEP, STEP_REACH)[visible])),
        "large_step_share": float(np.mean(near_steps(disparity, LARGE_STEP, STEP_REACH)[visible])),
        "occluded_share": float(np.mean(_hidden_from_right(disparity)[visible])),
    }
    steps, _ = find_steps(disparity, LARGE_STEP)
    if len(steps.rows):
        # Texture on each side, one window away from the step.
        last, window = disparity.shape[1] - 1, truth.rig.window
        near = np.clip(steps.near - window * steps.away, 0, last)
        far = np.clip(steps.far + window * steps.away, 0, last)
        # Plus one gray level: texture below the rounding of the image does not count.
        ratio = (truth.gradient[steps.rows, near] + 1) / (truth.gradient[steps.rows, far] + 1)
        facts["step_contrast"] = float(np.median(np.log(ratio)))
    return facts


def _hidden_from_right(disparity: np.ndarray) -> np.ndarray:
    """Return which pixels something nearer covers in the right eye, (height, width), bool.

    Points of a row keep their order in the right eye unless one covers another: a point is hidden if
    one farther right lands to its left. Thin foreground objects break the rule; for an estimate it will do.
    """
    landing = np.arange(disparity.shape[1], dtype=np.float32) - np.nan_to_num(disparity)
    leftmost = np.minimum.accumulate(landing[:, ::-1], axis=1)[:, ::-1]
    return landing > leftmost + 0.5  # half a pixel of tolerance for rounding


def _surfaces(truth: FrameTruth, visible: np.ndarray) -> dict[str, float]:
    count = np.count_nonzero(visible)
    kinds = (("specular", is_glossy), ("mirror", is_mirror), ("transparent", is_transparent))
    facts = {"grazing_share": float(np.mean(width_ratio(truth.slope[visible]) > GRAZING_RATIO))}
    for name, test in kinds:
        pixels = pixels_of(truth, test)
        facts[f"{name}_share"] = 0.0 if pixels is None else np.count_nonzero(pixels) / count
    if facts["specular_share"] > 0:
        facts["highlight_shift"] = _highlight_shift(truth)
    return facts


def _highlight_shift(truth: FrameTruth) -> float:
    glossy = pixels_of(truth, is_glossy)
    assert glossy is not None  # the caller has checked that there are some
    highlight = highlights_on(truth, glossy)
    if not highlight.any():
        return 0.0
    shift = virtual_disparity(truth, highlight)[highlight] - truth.disparity[highlight]
    return float(np.percentile(np.abs(shift), PERCENTILE))


def _motion(truth: FrameTruth) -> dict[str, float]:
    u, v = image_motion(
        truth.depth[::MOTION_STRIDE, ::MOTION_STRIDE],
        truth.camera.intrinsics,
        truth.motion.velocity_cam,
        truth.motion.angular_velocity_cam,
    )
    speed = float(np.percentile(np.hypot(u, v), PERCENTILE))
    return {
        "blur_px": speed * truth.rig.exposure_time,
        "skew_px": speed * truth.rig.readout_time,
    }
