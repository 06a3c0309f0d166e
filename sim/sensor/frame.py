"""What an effect knows about a frame (`FrameTruth`), what it changes (`Sensed`), and why (`Cause`)."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Protocol

import numpy as np

from digs_warp.geometry.camera import Camera
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.drift import NO_DRIFT, Drift
from digs_warp.sim.sensor.filters import box_mean, gray_of, horizontal_gradient
from digs_warp.sim.sensor.highlights import Highlights
from digs_warp.sim.sensor.right_eye import HIDDEN, UNSURE, classify


class Cause(IntEnum):
    """One label per pixel, set by the last effect that removed or replaced the value.

    Effects that only shift a value within the sensor's noise (steps, static field) do not change the label.
    Numbers that are missing here belong to causes that no tier has any more.

    Attributes:
        meaning: in words, for people.
    """

    meaning: str

    def __new__(cls, number: int, meaning: str) -> "Cause":
        """Return a member; it is its number."""
        member = int.__new__(cls, number)
        member._value_ = number
        member.meaning = meaning
        return member

    OK = 0, "right up to the sensor's noise"
    BAND = 1, "the left margin, outside the right eye's view"
    OCCLUDED = 2, "hidden from the right eye by something nearer"
    WEAK_TEXTURE = 4, "texture below the image noise"
    SPECULAR = 6, "the highlight was matched, not the surface"
    MIRROR = 7, "the reflected scene was matched"
    TRANSPARENT = 8, "the background behind glass was matched"
    EXPOSURE = 9, "saturated or too dark to match"
    NEAR = 10, "nearer than the sensor's range"
    FAR = 11, "farther than the sensor's range"
    EDGE = 12, "the matching window straddles a depth step"
    RECTIFICATION = 15, "the calibration has drifted: wrong columns, or rows that are not aligned"
    RANDOM = 16, "dropped for no visible reason"
    LOW_CONFIDENCE = 18, "the device does not trust the match"


# Gradient over image noise above which a patch is matched: 99 % of the pixels at 0.24, 9 % at 0.12.
MATCHABLE_SNR = 0.25

# Noise of the luma per noise of a channel: the root of the sum of squared weights (Rec. 601).
LUMA_NOISE = float(np.hypot(np.hypot(0.299, 0.587), 0.114))

# Rounding to 8 bits; no patch has less noise.
ROUNDING_NOISE = 1 / np.sqrt(12)


def noise_of(image_noise: float) -> float:
    """Return the noise of the luma, which a gradient must exceed to be matched [DN].

    Args:
        image_noise: of each color channel [DN]; the channels' noise is independent.
    """
    return max(LUMA_NOISE * image_noise, ROUNDING_NOISE)


# A metal this smooth reflects its surroundings sharply.
MIRROR_METALLIC, MIRROR_ROUGHNESS = 0.5, 0.1

# Rougher surfaces blur a highlight so much that it has no gradient to match.
GLOSSY_ROUGHNESS = 0.3


def is_mirror(material: Material) -> bool:
    """Whether a matcher matches the reflected scene instead of the surface."""
    return material.metallic > MIRROR_METALLIC and material.roughness < MIRROR_ROUGHNESS


def is_glossy(material: Material) -> bool:
    """Whether the surface shows sharp highlights without being a mirror.

    Glass does not count: what is bright there mostly lies behind it.
    """
    return (
        material.roughness < GLOSSY_ROUGHNESS
        and not is_mirror(material)
        and not is_transparent(material)
    )


def is_transparent(material: Material) -> bool:
    """Whether the background shows more strongly than the surface."""
    return material.is_transparent


class FrameRays(Protocol):
    """Rays that only some effects need; a renderer casts them on request."""

    def right_visibility(self, where: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Whether the right eye sees the point at each left pixel center, (height, width), bool.

        Here and below, rays are cast only at ``where``, (height, width), bool. The other pixels count as
        visible. ``depth``: planar z of what the left eye sees [m], (height, width), float32.
        """
        ...

    def reflection_distance(self, where: np.ndarray) -> np.ndarray:
        """Distance from the surface to what it reflects [m], (height, width), float32; NaN elsewhere."""
        ...

    def depth_behind(self, where: np.ndarray) -> np.ndarray:
        """Planar depth of the first opaque surface [m], (height, width), float32; NaN elsewhere."""
        ...


@dataclass(frozen=True)
class Motion:
    """How the left camera moves during a frame, in its own axes."""

    velocity_cam: tuple[float, float, float]  # [m/s]
    angular_velocity_cam: tuple[float, float, float]  # [rad/s]


@dataclass(frozen=True, eq=False)
class FrameTruth:
    """The truth of one frame, as rendered, at the pixel centers of the left eye.

    Attributes:
        number: of the frame, >= 0; part of every seed.
        camera: the left eye.
        rig: focal length, baseline and the parameters of the sensor.
        image, right: images of the two eyes, sRGB, (height, width, 3), uint8, before sensor noise.
        depth: planar z [m], (height, width), float32, NaN where there is nothing.
        normals_world: unit normals toward the viewer, (height, width, 3), float32.
        material_ids: index into ``materials``, (height, width), int32; -1: the surround.
        materials: of the scene.
        motion: of the rig.
        rays: more rays on request.
        drift: of the right eye; ``right`` is what the drifted eye sees.
        dots_show: where the center of a projected dot would stand out of the image noise, (height, width),
            bool; None: the camera has no projector, or it is off.
        right_mask: of the object in ``right``, (height, width), uint8; None: not rendered.
        highlights, right_highlights: the light above white in the two images; None: unknown.
    """

    number: int
    camera: Camera
    rig: StereoRig
    image: np.ndarray
    right: np.ndarray
    depth: np.ndarray
    normals_world: np.ndarray
    material_ids: np.ndarray
    materials: tuple[Material, ...]
    motion: Motion
    rays: FrameRays
    drift: Drift = NO_DRIFT
    dots_show: np.ndarray | None = None
    right_mask: np.ndarray | None = None
    highlights: Highlights | None = None
    right_highlights: Highlights | None = None

    # Computed once, when the first effect needs it.

    @cached_property
    def disparity(self) -> np.ndarray:
        """True disparity f b / Z [px], (height, width), float32, NaN where there is nothing."""
        return np.float32(self.rig.focal_baseline) / self.depth.astype(np.float32, copy=False)

    @cached_property
    def shown_disparity(self) -> np.ndarray:
        """The disparity that the images show: ``disparity``, unless the calibration has drifted."""
        return self.drift.shown_disparity(self.disparity, self.rig.intrinsics)

    @cached_property
    def gray(self) -> np.ndarray:
        """Luma of the left image [DN], (height, width), uint8."""
        return gray_of(self.image)

    @cached_property
    def texture_snr(self) -> np.ndarray:
        """RMS horizontal gradient in the matching window over the image noise, (height, width), float32."""
        square = box_mean(np.square(horizontal_gradient(self.gray)), self.rig.window)
        return np.sqrt(square) / np.float32(noise_of(self.rig.image_noise))

    def pixels_of(self, test: Callable[[Material], bool]) -> np.ndarray | None:
        """Return where the material passes ``test``, (height, width), bool; None: no material passes."""
        passing = [number for number, material in enumerate(self.materials) if test(material)]
        if not passing:
            return None
        where = self.material_ids == passing[0]
        for number in passing[1:]:
            where |= self.material_ids == number
        return where & np.isfinite(self.depth)

    @cached_property
    def hidden(self) -> np.ndarray:
        """Which pixels an opaque surface hides from the right eye, (height, width), bool."""
        return self.hidden_among(np.ones(self.depth.shape, bool))

    def hidden_among(self, where: np.ndarray) -> np.ndarray:
        """Return which pixels of ``where`` are `hidden`, both (height, width), bool.

        Points that land outside the right image do not count: that is the invalid band, not occlusion.
        """
        opaque, transparent = self.disparity, self.pixels_of(is_transparent)
        if transparent is not None:
            opaque = np.where(transparent, np.float32(np.nan), opaque)
        state = classify(self.disparity, opaque, where)
        hidden, unsure = state == HIDDEN, state == UNSURE
        if unsure.any():
            hidden |= unsure & ~self.rays.right_visibility(unsure, self.depth)
        return hidden


@dataclass(frozen=True, eq=False)
class Sensed:
    """The sensor's measurement, changed by one effect after another.

    Attributes:
        disparity: [px], (height, width), float32; NaN where the sensor reports nothing.
        cause: `Cause` of each pixel, (height, width), uint8.
        confidence: 0 to 1, (height, width), float32.
    """

    disparity: np.ndarray
    cause: np.ndarray
    confidence: np.ndarray

    @staticmethod
    def of(truth: FrameTruth) -> "Sensed":
        """Return the measurement of a perfect sensor."""
        shape = truth.depth.shape
        cause = np.full(shape, Cause.OK, dtype=np.uint8)
        return Sensed(truth.disparity, cause, np.ones(shape, dtype=np.float32))

    @property
    def known(self) -> np.ndarray:
        """Where the sensor reports a value, (height, width), bool."""
        return ~np.isnan(self.disparity)

    def with_holes(self, where: np.ndarray, cause: Cause) -> "Sensed":
        """Return the frame without values at ``where`` (bool); existing holes keep their label."""
        lost = where & self.known
        if not lost.any():
            return self
        images = (self.disparity, np.nan), (self.cause, cause), (self.confidence, 0)
        return Sensed(*(np.where(lost, image.dtype.type(value), image) for image, value in images))
