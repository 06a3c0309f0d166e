"""What the default sensor measures with chosen effects, for tests of what comes after it."""

from collections.abc import Collection

import numpy as np

from digs_warp.sim.sensor.color.image_noise import ReadNoise, ShotNoise
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.effects import AFTER_MATCHING
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.tiers import depth_of, sense

IMAGE_NOISE = (ShotNoise(), ReadNoise())

# Effects that change depth at every scene.
NAMES = tuple(effect.name for effect in (*IMAGE_NOISE, *AFTER_MATCHING))


def sensed_depth(
    truth: FrameTruth, effects: Collection[str], strength: float = 1.0, seed: int = 0
) -> np.ndarray:
    """Depth [m] with the named effects alone; the truth where there are none.

    Image noise is in the images that are matched, not in those that are recorded.
    """
    if not effects:
        return truth.depth
    noise = [effect for effect in IMAGE_NOISE if effect.name in effects]
    plan = [Choice(name, True, "", "", "") for name in effects]
    recorded = recorded_images(truth, noise, seed, strength)
    return depth_of(sense(truth, "guided", plan, seed, strength, recorded), truth)
