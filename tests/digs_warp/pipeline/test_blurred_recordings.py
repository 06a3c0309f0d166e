"""Recordings of a moving camera with a long exposure: what the reconstruction makes of them, and says."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from digs_warp.data.capture import Capture
from digs_warp.init.config import InitConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.train.config import Stop, TrainConfig
from reference.tiny_capture import write_tiny_capture
from reference.trained_ball import assert_same_bits, interrupt, score_of_perfect_views

STEPS = 120
CONFIG = ReconstructConfig(
    init=InitConfig(voxel_size=0.012),
    train=TrainConfig(stop=Stop(iterations=STEPS), sh_degree=0, evaluate_at=(), motion_blur="on"),
)
OFF = replace(CONFIG, train=replace(CONFIG.train, motion_blur="off"))


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_tiny_capture(tmp_path_factory.mktemp("blurred") / "capture", blurred=True)


@pytest.fixture(scope="module")
def drawn(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Reconstruction:
    return reconstruct(capture, CONFIG, tmp_path_factory.mktemp("drawn"))


def test_the_result_is_closer_to_what_a_perfect_camera_sees(
    capture: Capture, drawn: Reconstruction, tmp_path: Path
) -> None:
    ignored = reconstruct(capture, OFF, tmp_path / "ignored")
    with_blur = score_of_perfect_views(drawn.gaussians, tmp_path / "perfect")
    without = score_of_perfect_views(ignored.gaussians, tmp_path / "again")
    assert with_blur.psnr_object > without.psnr_object + 0.2
    # The held-out photographs are blurred, too: drawn so, they fit.
    assert drawn.scores.mean.psnr_object > ignored.scores.mean.psnr_object + 1.0


def test_the_run_says_what_was_decided_and_why(drawn: Reconstruction) -> None:
    assert drawn.folder is not None and drawn.training.motion_blur is not None
    said = json.loads((drawn.folder / "run.json").read_text())["results"]["training"]["motion_blur"]
    assert said["frames"] == 16 and said["moments"] >= 2
    assert f"moves {said['blur_px']:.2f} px" in said["because"]
    assert Reconstruction.load(drawn.folder).training.motion_blur == drawn.training.motion_blur


def test_an_interrupted_run_resumes_to_the_same_bits(
    capture: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = replace(CONFIG, train=replace(CONFIG.train, stop=Stop(iterations=16)))
    whole = reconstruct(capture, config, tmp_path / "whole")
    parts = tmp_path / "parts"
    interrupt(lambda: reconstruct(capture, config, parts), 9, monkeypatch)
    resumed = reconstruct(capture, config, parts, resume=True)
    assert_same_bits(resumed.gaussians, whole.gaussians)
