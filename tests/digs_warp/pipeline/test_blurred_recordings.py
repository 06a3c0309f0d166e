"""Recordings of a moving camera with a long exposure: what the reconstruction makes of them, and says."""

import json
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import FIELDS
from digs_warp.init.config import InitConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.config import Stop, TrainConfig
from digs_warp.train.evaluate import load_test_views, render_views, score_views
from digs_warp.train.trainer import Trainer
from reference.tiny_capture import write_tiny_capture

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


def psnr_of_perfect_views(result: Reconstruction, folder: Path) -> float:
    """Against the ball as a camera sees it that does not move."""
    views = load_test_views(write_tiny_capture(folder, 5).frames)
    images = render_views(DeviceGaussians.from_numpy(result.gaussians), views)
    return float(np.mean([score.psnr_object for score in score_views(images, views)]))


def test_the_result_is_closer_to_what_a_perfect_camera_sees(
    capture: Capture, drawn: Reconstruction, tmp_path: Path
) -> None:
    ignored = reconstruct(capture, OFF, tmp_path / "ignored")
    with_blur = psnr_of_perfect_views(drawn, tmp_path / "perfect")
    without = psnr_of_perfect_views(ignored, tmp_path / "again")
    assert with_blur > without + 0.2
    # The held-out photographs are blurred, too: drawn so, they fit.
    assert drawn.scores.mean.psnr_object > ignored.scores.mean.psnr_object + 1.0


def test_the_run_says_what_was_decided_and_why(drawn: Reconstruction) -> None:
    assert drawn.folder is not None and drawn.shutter is not None
    said = json.loads((drawn.folder / "run.json").read_text())["results"]["motion_blur"]
    assert said["frames"] == 16 and said["moments"] >= 2
    assert f"moves {said['blur_px']:.2f} px" in said["because"]
    assert Reconstruction.load(drawn.folder).shutter == drawn.shutter


def test_an_interrupted_run_resumes_to_the_same_bits(
    capture: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = replace(CONFIG, train=replace(CONFIG.train, stop=Stop(iterations=16)))
    whole = reconstruct(capture, config, tmp_path / "whole")
    step = Trainer.step

    def step_until_interrupted(trainer: Trainer) -> None:
        if trainer.optimizer.step == 9:
            signal.raise_signal(signal.SIGINT)
        step(trainer)

    with monkeypatch.context() as patched:
        patched.setattr(Trainer, "step", step_until_interrupted)
        with pytest.raises(KeyboardInterrupt):
            reconstruct(capture, config, tmp_path / "parts")
    resumed = reconstruct(capture, config, tmp_path / "parts", resume=True)
    for name in FIELDS:
        np.testing.assert_array_equal(
            getattr(resumed.gaussians, name), getattr(whole.gaussians, name), err_msg=name
        )
