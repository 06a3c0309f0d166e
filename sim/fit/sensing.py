"""A frame through the simulated sensor, with the effects that belong to the camera and not to the scene."""

import numpy as np

from digs_warp.sim.config import Tier
from digs_warp.sim.sensor.color.image_noise import ReadNoise, ShotNoise
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.effects.quantum import Quantum
from digs_warp.sim.sensor.effects.static_field import StaticField
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.infrared.pair import in_three_channels, one_channel
from digs_warp.sim.sensor.tiers import sense

# Noise of the images, static field and fixed point are as strong as the rig says; a drift is in the frame.
ON_IMAGES = (ShotNoise(), ReadNoise())
ON_DEPTH = (StaticField.name, Quantum.name)


def sense_frame(
    frame: FrameTruth, tier: Tier = "guided", seed: int = 0, gray: bool = False
) -> tuple[tuple[np.ndarray, np.ndarray], Sensed]:
    """Return the two images as recorded, and what the sensor measures on them.

    Args:
        frame: what the eyes see; its rig has the figures.
        tier: of the sensor.
        seed: of the noise.
        gray: the eyes see no color, as those of an infrared pair: the noise of a pixel is one value. Three
            independent ones have a third less on their brightness, which is matched.
    """
    recorded = recorded_images(frame, ON_IMAGES, seed)
    if gray:
        left, right = (in_three_channels(one_channel(image)) for image in recorded)
        recorded = left, right
    choices = [Choice(name, True, "", "", "") for name in ON_DEPTH]
    return recorded, sense(frame, tier, choices, seed, recorded=recorded)


def is_gray(images: np.ndarray) -> bool:
    """Whether recorded images, (..., 3), are of eyes without color; noise of others differs by channel."""
    return bool((images == images[..., :1]).all())
