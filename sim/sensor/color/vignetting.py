"""The lens: it spreads points, and the image gets darker toward its corners.

A lens gathers less light off its axis: cos^4 of the angle. Cameras compensate for most of this. The rig
states how much light the corners still lose; the law gives the shape of the loss.
"""

from functools import lru_cache

import numpy as np

from digs_warp.geometry.camera import Intrinsics, pixel_centers
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.color.protocol import EyeImages, PixelEffect
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.filters import blurred


class LensBlur(PixelEffect):
    """The point spread of the lens after the sharpening of the camera: a Gaussian on the light.

    Its MTF at a quarter of a cycle per pixel is exp(-2 (pi sigma / 4)^2).
    """

    name = "lens-blur"
    statistic = "lens_blur"
    unit = "px"
    cost = 6.0
    on = "the lens spreads every point over several pixels"
    off = "the lens is taken for perfect"

    def measured(self, facts: SceneFacts, rig: StereoRig) -> float:
        """Return the wider one of eyes and color camera."""
        return max(rig.lens_blur, rig.color_blur)

    def apply(
        self, eyes: EyeImages, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> EyeImages:
        """Blur both images; ``strength`` is a factor on the width."""
        sigma = strength * rig.lens_blur
        if sigma == 0:
            return eyes
        return eyes.with_images(blurred(eyes.left, sigma), blurred(eyes.right, sigma))


# Smallest visible loss in the corners: about one 8-bit step.
VISIBLE_LOSS = 0.01


class Vignetting(PixelEffect):
    """The lens darkens both images toward their corners."""

    name = "vignetting"
    statistic = "vignetting"
    limit = VISIBLE_LOSS
    cost = 11.0
    on = "the lens gives the corners visibly less light"
    off = "the corners lose too little light to notice"

    def apply(
        self, eyes: EyeImages, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> EyeImages:
        """Multiply both images by the lens's transmission."""
        gain = _transmission(eyes.intrinsics, strength * rig.vignetting, eyes.left.shape[2])
        return eyes.with_images(eyes.left * gain, eyes.right * gain)


@lru_cache(maxsize=2)  # the eyes, and a color camera beside them
def _transmission(k: Intrinsics, lost: float, channels: int) -> np.ndarray:
    """Return the share of light that is left, (height, width, channels), float32; ``lost``: in corners."""
    tangents = (pixel_centers(k.width, k.height) - [k.cx, k.cy]) / [k.fx, k.fy]
    loss = 1 - 1 / (1 + (tangents**2).sum(axis=-1, keepdims=True)) ** 2  # cos^4
    # A single pixel on the axis loses nothing.
    falloff = (loss / max(loss.max(), 1e-12)).astype(np.float32)
    # Repeated for each channel: four times as fast as broadcasting.
    return np.repeat(1 - np.float32(lost) * falloff, channels, axis=2)
