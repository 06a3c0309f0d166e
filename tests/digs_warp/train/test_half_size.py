"""When a run trains on images of half the size."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.train.config import Density, Stop, TrainConfig
from digs_warp.train.half_size import DENSE_STEPS, MIN_WIDTH_PX, half_size_steps, typical_width_px
from reference.tiny_capture import ball

UP = np.array([0.0, 0.0, 1.0])
# 2 m away with a focal length of 400 px: a millimetre is 0.2 px wide.
CAMERAS = [
    Camera(Intrinsics(320, 240, 400.0, 400.0, 160.0, 120.0), look_at(eye, np.zeros(3), UP))
    for eye in 2.0 * np.eye(3)[:2]
]


def test_the_width_on_the_image() -> None:
    gaussians = replace(ball(), log_scales=np.full((1500, 3), np.log(0.01)))
    assert typical_width_px(gaussians, CAMERAS) == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize(("width", "steps"), [(1.1 * MIN_WIDTH_PX, 50), (0.9 * MIN_WIDTH_PX, 0)])
def test_gaussians_narrower_than_the_pixels_see_whole_images_only(width: float, steps: int) -> None:
    scale = 2 * width / 200  # [m]; halved, a metre is 100 px
    gaussians = replace(ball(), log_scales=np.full((1500, 3), np.log(scale)))
    assert half_size_steps(TrainConfig(stop=Stop(iterations=100)), gaussians, CAMERAS) == steps
    long = TrainConfig(stop=Stop(iterations=5000))
    assert half_size_steps(long, gaussians, CAMERAS) == (DENSE_STEPS if steps else 0)
    asked = TrainConfig(stop=Stop(iterations=100), half_size_until=0.3)
    assert half_size_steps(asked, gaussians, CAMERAS) == 30


def test_growing_populations_start_at_full_size() -> None:
    gaussians = replace(ball(), log_scales=np.zeros((1500, 3)))
    assert half_size_steps(TrainConfig(density=Density(strategy="mcmc")), gaussians, CAMERAS) == 0
