"""What the planner knows about a scene: motion in the image, shares of pixels, extremes over frames."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.images import linear_from_srgb
from digs_warp.geometry.camera import Intrinsics
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.frame import FrameTruth, is_mirror, is_transparent


def image_motion(
    depth: np.ndarray,
    intrinsics: Intrinsics,
    velocity_cam: tuple[float, float, float],
    angular_velocity_cam: tuple[float, float, float],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the velocity (u, v) of the image of a static scene [px/s], each (height, width), float32.

    With the camera at velocity t and angular velocity w (its own axes), a point P = Z (x, y, 1) moves
    at -t - w x P in the camera; its image follows (Longuet-Higgins and Prazdny 1980, eq. 2).

    Args:
        depth: planar z [m], (height, width), at any resolution; NaN counts as infinitely far.
        intrinsics: of the camera.
        velocity_cam: [m/s].
        angular_velocity_cam: [rad/s].
    """
    k = intrinsics
    height, width = depth.shape
    x = ((np.arange(width, dtype=np.float32) + 0.5) * (k.width / width) - k.cx) / k.fx
    y = ((np.arange(height, dtype=np.float32) + 0.5) * (k.height / height) - k.cy) / k.fy
    y = y[:, None]
    tx, ty, tz = (np.float32(value) for value in velocity_cam)
    wx, wy, wz = (np.float32(value) for value in angular_velocity_cam)
    inverse = np.nan_to_num(1 / depth.astype(np.float32, copy=False), nan=0.0)
    u = k.fx * ((tz * x - tx) * inverse + wx * x * y - wy * (1 + x * x) + wz * y)
    v = k.fy * ((tz * y - ty) * inverse + wx * (1 + y * y) - wy * x * y - wz * x)
    return u, v


# Thresholds of the statistics; the effects that use them give the sources.
STEP = 1.0  # [px]
SATURATED, DARK = 250, 15  # [DN]

# Motion of the image that shows [px].
VISIBLE_MOTION = 0.5

# Pixels along a row at which motion is measured.
MOTION_WIDTH = 96

# The mean color needs few pixels; a prime, so that they do not lie in columns.
CAST_STRIDE = 31
DARKEST = 1e-6  # linear; a black image has no cast

PERCENTILE = 95


@dataclass(frozen=True, kw_only=True)
class SceneFacts:
    """Statistics of one or more frames; shares are of the pixels that show something, 0 to 1.

    The effects that use the thresholds give their sources.
    """

    frames: int
    min_depth: float  # [m]
    max_depth: float  # [m]
    mirror_share: float  # share with metallic > 0.5 and roughness < 0.1
    transparent_share: float  # share of transparent materials
    saturated_share: float  # share above 250 of 255
    dark_share: float  # share below 15 of 255
    color_cast: float  # |log2| of red or blue over green in the mean color, the larger one [stops]
    blurred_share: float  # share that moves more than half a pixel during the exposure
    skewed_share: float  # share that moves more than half a pixel during the shutter's read-out
    blur_px: float  # 95th percentile of the motion during the exposure [px]
    skew_px: float  # 95th percentile of the motion during the shutter's read-out [px]
    dot_share: float = 0.0  # share where a projected dot stands out of the image noise


# Extremes over the frames; every other fact is the mean over those where it can be measured.
_EXTREMES = {"min_depth": np.min, "max_depth": np.max}


def measure_facts(frames: Sequence[FrameTruth], rig: StereoRig) -> SceneFacts:
    """Return the facts of a scene from some of its frames.

    Facts that cannot be measured (nothing in view) are 0, except the depths, which are NaN.

    Args:
        frames: at least one, of any size.
        rig: of the recording.

    Raises:
        DigsError: no frames.
    """
    if not frames:
        raise DigsError("facts: no frames, expected at least one")
    measured = [_measure(frame, rig) for frame in frames]
    facts: dict[str, float] = {}
    for name in (field.name for field in fields(SceneFacts) if field.name != "frames"):
        values = np.array([m[name] for m in measured if name in m and np.isfinite(m[name])])
        if len(values) == 0:
            facts[name] = np.nan if name in _EXTREMES else 0.0
        else:
            facts[name] = float(_EXTREMES.get(name, np.mean)(values))
    return SceneFacts(frames=len(frames), **facts)


def _measure(truth: FrameTruth, rig: StereoRig) -> dict[str, float]:
    """Return the facts of one frame; a fact that cannot be measured is left out."""
    visible = np.isfinite(truth.depth)
    if not visible.any():
        return {}
    depth, gray = truth.depth[visible], truth.gray[visible]
    return {
        "min_depth": float(depth.min()),
        "max_depth": float(depth.max()),
        "saturated_share": float(np.mean(gray > SATURATED)),
        "dark_share": float(np.mean(gray < DARK)),
        "color_cast": _color_cast(truth.image[visible]),
        **_materials(truth, len(depth)),
        **_motion(truth, rig),
        "dot_share": 0.0 if truth.dots_show is None else float(np.mean(truth.dots_show[visible])),
    }


def _color_cast(pixels: np.ndarray) -> float:
    """Return by how many stops red or blue differ from green in the mean of sRGB pixels, (n, 3)."""
    red, green, blue = linear_from_srgb(pixels[::CAST_STRIDE] / 255.0).mean(axis=0) + DARKEST
    return float(np.abs(np.log2([red / green, blue / green])).max())


def _materials(truth: FrameTruth, count: int) -> dict[str, float]:
    shares: dict[str, float] = {}
    for name, test in (("mirror", is_mirror), ("transparent", is_transparent)):
        pixels = truth.pixels_of(test)
        shares[f"{name}_share"] = 0.0 if pixels is None else np.count_nonzero(pixels) / count
    return shares


def _motion(truth: FrameTruth, rig: StereoRig) -> dict[str, float]:
    motion = truth.motion
    # Motion is smooth over the image: few pixels are enough.
    step = max(1, truth.depth.shape[1] // MOTION_WIDTH)
    u, v = image_motion(
        truth.depth[::step, ::step],
        rig.intrinsics,
        motion.velocity_cam,
        motion.angular_velocity_cam,
    )
    speed = np.hypot(u, v)
    facts: dict[str, float] = {}
    for name, time in (("blur", rig.exposure_time), ("skew", rig.readout_time)):
        facts[f"{name}_px"] = float(np.percentile(speed, PERCENTILE)) * time
        share = "blurred_share" if name == "blur" else "skewed_share"
        facts[share] = float(np.mean(speed * time > VISIBLE_MOTION))
    return facts
