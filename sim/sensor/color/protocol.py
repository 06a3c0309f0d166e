"""What an effect on the images changes."""

from dataclasses import dataclass, replace

import numpy as np

from digs_warp.geometry.camera import Intrinsics
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.color.adaptation import NOT_ADAPTED, Adaptation
from digs_warp.sim.sensor.effects.protocol import Effect

# A figure for red, green and blue.
ByChannel = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class EyeImages:
    """The light on the two sensors, linear; 1 is white.

    Attributes:
        intrinsics: of either eye.
        left, right: shape (height, width, 3), float32; (height, width, 1) of infrared eyes.
        adaptation: what exposure and white balance are set to.
        electronic_gain: by which the electronics have multiplied the signal so far, and its noise.
        is_clipped: whether light above white is lost; if not, values exceed 1 until a gain clips them.
    """

    intrinsics: Intrinsics
    left: np.ndarray
    right: np.ndarray
    adaptation: Adaptation = NOT_ADAPTED
    electronic_gain: ByChannel = (1.0, 1.0, 1.0)
    is_clipped: bool = True

    def with_images(self, left: np.ndarray, right: np.ndarray) -> "EyeImages":
        """Return the same eyes with new images."""
        return replace(self, left=left, right=right)


class PixelEffect(Effect):
    """An effect that changes the rendered images."""

    def apply(
        self, eyes: EyeImages, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> EyeImages:
        """Return the images after the effect; ``rng`` is seeded by (seed, frame, effect)."""
        raise NotImplementedError
