"""Recordings of a moving camera, with a rolling shutter or a long exposure: what becomes of them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from digs_warp.data.capture import Capture, read_capture
from digs_warp.init.config import InitConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
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


@pytest.fixture(scope="module")
def rolling(make_once: Callable[..., Path]) -> Capture:
    found = read_capture(make_once("rolling", lambda out: write_tiny_capture(out, rolling=True)))
    return replace(found, held_out=HELD_OUT)


@pytest.fixture(scope="module")
def blurred(make_once: Callable[..., Path]) -> Capture:
    found = read_capture(make_once("blurred", lambda out: write_tiny_capture(out, blurred=True)))
    return replace(found, held_out=HELD_OUT)


@pytest.fixture(scope="module")
def corrected(rolling: Capture, tmp_path_factory: pytest.TempPathFactory) -> Reconstruction:
    return reconstruct(rolling, ROLLING, tmp_path_factory.mktemp("corrected"))


@pytest.fixture(scope="module")
def drawn(blurred: Capture, tmp_path_factory: pytest.TempPathFactory) -> Reconstruction:
    return reconstruct(blurred, BLURRED, tmp_path_factory.mktemp("drawn"))


def test_a_rolling_shutter_is_closer_to_what_a_perfect_camera_sees(
    rolling: Capture, corrected: Reconstruction, tmp_path: Path
) -> None:
    off = replace(ROLLING, train=replace(ROLLING.train, rolling_shutter="off"))
    ignored = reconstruct(rolling, off, tmp_path / "ignored")
    with_shutter = score_of_perfect_views(corrected.gaussians, tmp_path / "perfect")
    without = score_of_perfect_views(ignored.gaussians, tmp_path / "again")
    assert with_shutter.psnr_frame > without.psnr_frame + 1.0
    # The held-out photographs have the same shutter: drawn with it, they fit, too.
    assert corrected.scores.mean.psnr_frame > ignored.scores.mean.psnr_frame + 1.0


def test_a_long_exposure_is_closer_to_what_a_perfect_camera_sees(
    blurred: Capture, drawn: Reconstruction, tmp_path: Path
) -> None:
    off = replace(BLURRED, train=replace(BLURRED.train, motion_blur="off"))
    ignored = reconstruct(blurred, off, tmp_path / "ignored")
    with_blur = score_of_perfect_views(drawn.gaussians, tmp_path / "perfect")
    without = score_of_perfect_views(ignored.gaussians, tmp_path / "again")
    assert with_blur.psnr_object > without.psnr_object + 0.05
    # The held-out photographs are blurred, too: drawn so, they fit.
    assert drawn.scores.mean.psnr_object > ignored.scores.mean.psnr_object + 1.0
