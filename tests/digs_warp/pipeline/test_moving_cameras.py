"""Recordings of a moving camera, with a rolling shutter or a long exposure: what becomes of them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from digs_warp.data.capture import read_capture
from digs_warp.init.config import InitConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.train.config import Stop, TrainConfig
from reference.tiny_capture import write_tiny_capture
from reference.trained_ball import score_of_perfect_views

ROLLING = ReconstructConfig(
    init=InitConfig(voxel_size=0.012),
    train=TrainConfig(stop=Stop(iterations=60), sh_degree=0, evaluate_at=()),
)
BLURRED = replace(
    ROLLING, train=replace(ROLLING.train, stop=Stop(iterations=120), motion_blur="on")
)

# Two that have neighbors of their own height.
HELD_OUT = frozenset({"0000", "0008"})


# What is recorded: how it is trained, what leaves the motion out, and by how much a score falls then [dB].
KINDS = {
    "rolling": (ROLLING, {"rolling_shutter": "off"}, "psnr_frame", 1.0),
    "blurred": (BLURRED, {"motion_blur": "off"}, "psnr_object", 0.02),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_moving_camera_is_closer_to_what_a_perfect_one_sees(
    make_once: Callable[..., Path], tmp_path: Path, kind: str
) -> None:
    config, off, score, least = KINDS[kind]
    folder = make_once(kind, lambda out: write_tiny_capture(out, **{kind: True}))
    capture = replace(read_capture(folder), held_out=HELD_OUT)
    ignoring = replace(config, train=replace(config.train, **off))
    perfect, held_out = [], []
    for number, each in enumerate((config, ignoring)):
        result = reconstruct(capture, each, tmp_path / str(number))
        seen = score_of_perfect_views(result.gaussians, tmp_path / f"perfect {number}")
        perfect.append(getattr(seen, score))
        held_out.append(getattr(result.scores.mean, score))
    assert perfect[0] > perfect[1] + least
    # The held-out photographs were taken in motion, too: drawn so, they fit.
    assert held_out[0] > held_out[1] + 1.0
