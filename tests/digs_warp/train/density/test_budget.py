"""The memory budget against what a trainer really allocates."""

from dataclasses import fields

import numpy as np
import pytest
import warp as wp

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.train.config import TrainConfig
from digs_warp.train.density.control import bytes_per_splat, check_start, splat_cap
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import ViewStore
from digs_warp.train.views import packed_view
from reference.splat_scenes import random_gaussians


@pytest.mark.parametrize("degree", [0, 1, 3])
def test_bytes_per_splat_are_those_of_a_run(degree: int) -> None:
    """The difference that 8,000 more Gaussians make, over 8,000."""
    pose = look_at(np.array([0.0, -3.0, 0.5]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    camera = Camera(Intrinsics.from_fov(320, 240, 60.0), pose)
    view = packed_view(
        "0", camera, np.zeros((240, 320, 3), np.uint8), np.full((240, 320), 255, np.uint8)
    )
    frame = Frame("0", camera, 0.0, {})
    config = TrainConfig(sh_degree=degree)
    held = []
    for count in (2_000, 10_000):
        store = ViewStore([frame], lambda step: 0, lambda frame: view, 100.0)
        trainer = Trainer(random_gaussians(count, seed=0, degree=degree), store, config)
        trainer.step()
        held.append(allocated(trainer))
    measured = (held[1] - held[0]) / 8_000
    assert bytes_per_splat(degree) == pytest.approx(measured, rel=0.35)


def allocated(trainer: Trainer) -> int:
    """Bytes of everything whose size follows the number of Gaussians."""
    adam = trainer.optimizer
    groups = (trainer.gaussians, trainer.renderer.gradients, adam.moments_1, adam.moments_2)
    arrays = [array for group in groups for array in group.arrays]
    binner = trainer.renderer.middle.binner
    arrays += [getattr(binner.lists, field.name) for field in fields(binner.lists)]
    arrays += [binner._order, binner._spare]
    return sum(array.capacity for array in arrays if isinstance(array, wp.array))


def test_the_smaller_of_cap_and_memory_counts() -> None:
    assert splat_cap(1000, None, 1) == 1000
    assert splat_cap(10**9, 64.0, 1) == 64 * 2**20 // bytes_per_splat(1)
    assert splat_cap(1000, 64.0, 1) == 1000


def test_a_start_beyond_the_cap_is_refused() -> None:
    check_start(1000, 1000)
    with pytest.raises(DigsError, match=r"starts with 1,001 Gaussians, but .* allow only 1,000"):
        check_start(1001, 1000)
