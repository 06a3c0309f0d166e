"""When to train on half-size images: early, and only while Gaussians are wider than the larger pixels.

Such a step takes a third of the time. But the renderer widens a Gaussian that is narrower than a pixel (its
dilation), and what it then learns is wrong at full size.
"""

from collections.abc import Sequence

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera
from digs_warp.train.config import TrainConfig

# Share of a run from a dense start, and the most steps. On the YCB mustard bottle (1600x900, 100 steps,
# 85,000 points 2 mm apart) half of the steps at half the size took 58 % of the time and gave 34.9 dB instead
# of 34.3 dB. Many more steps do harm: by then the Gaussians are narrower than the pixels.
DENSE_SHARE = 0.5
DENSE_STEPS = 100
# Smallest typical standard deviation at the start, in pixels of the halved image.
MIN_WIDTH_PX = 0.75


def may_halve(config: TrainConfig) -> bool:
    """Whether a run may use half-size views."""
    if config.half_size_until is not None:
        return config.half_size_until > 0
    return config.density.strategy == "fixed"


def half_size_steps(config: TrainConfig, start: Gaussians, cameras: Sequence[Camera]) -> int:
    """Return how many steps of a run use half-size images.

    Args:
        config: settings; ``half_size_until`` decides when it is set.
        start: the Gaussians at the start, at least one.
        cameras: the cameras of the whole views, at least one.
    """
    if config.half_size_until is not None:
        return int(config.half_size_until * config.stop.iterations)
    wide = typical_width_px(start, cameras) / 2 >= MIN_WIDTH_PX
    return (
        min(int(DENSE_SHARE * config.stop.iterations), DENSE_STEPS)
        if may_halve(config) and wide
        else 0
    )


def typical_width_px(gaussians: Gaussians, cameras: Sequence[Camera]) -> float:
    """Return the median standard deviation of the Gaussians as seen from a typical camera [px]."""
    center = np.median(gaussians.means, axis=0)
    zooms = [
        camera.intrinsics.fx / max(float(np.linalg.norm(camera.center_world - center)), 1e-9)
        for camera in cameras
    ]
    return float(np.median(gaussians.scales.max(axis=1)) * np.median(zooms))
