"""Recordings of a camera with a rolling shutter: what the reconstruction makes of them, and says."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from digs_warp.data.capture import Capture
from digs_warp.init.config import InitConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.train.config import Stop, TrainConfig
from reference.tiny_capture import READOUT_TIME, write_tiny_capture
from reference.trained_ball import assert_same_bits, interrupt, score_of_perfect_views

CONFIG = ReconstructConfig(
    init=InitConfig(voxel_size=0.012),
    train=TrainConfig(stop=Stop(iterations=60), sh_degree=0, evaluate_at=()),
)
OFF = replace(CONFIG, train=replace(CONFIG.train, rolling_shutter="off"))


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_tiny_capture(tmp_path_factory.mktemp("rolling") / "capture", rolling=True)


@pytest.fixture(scope="module")
def corrected(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Reconstruction:
    return reconstruct(capture, CONFIG, tmp_path_factory.mktemp("corrected"))


def test_the_result_is_closer_to_what_a_perfect_camera_sees(
    capture: Capture, corrected: Reconstruction, tmp_path: Path
) -> None:
    ignored = reconstruct(capture, OFF, tmp_path / "ignored")
    with_shutter = score_of_perfect_views(corrected.gaussians, tmp_path / "perfect")
    without = score_of_perfect_views(ignored.gaussians, tmp_path / "again")
    assert with_shutter.psnr_frame > without.psnr_frame + 1.0
    # The held-out photographs have the same shutter: drawn with it, they fit, too.
    assert corrected.scores.mean.psnr_frame > ignored.scores.mean.psnr_frame + 1.0


def test_the_run_says_what_was_decided_and_why(corrected: Reconstruction) -> None:
    assert corrected.folder is not None
    said = json.loads((corrected.folder / "run.json").read_text())["results"]["training"][
        "rolling_shutter"
    ]
    assert said["rolling"] is True
    assert said["readout_time"] == READOUT_TIME
    assert f"moves {said['skew_px']:.2f} px" in said["because"]
    assert (
        Reconstruction.load(corrected.folder).training.rolling_shutter
        == corrected.training.rolling_shutter
    )


def test_the_readout_time_of_the_settings_counts_more_than_that_of_the_recording(
    capture: Capture, tmp_path: Path
) -> None:
    short = replace(CONFIG.train, stop=Stop(iterations=1))
    found = reconstruct(
        capture,
        replace(CONFIG, train=short, sfm=SfmConfig(poses="capture", readout_time=0.0)),
        tmp_path,
    )
    assert found.training.rolling_shutter is not None and not found.training.rolling_shutter.rolling


def test_an_interrupted_run_resumes_to_the_same_bits(
    capture: Capture,
    corrected: Reconstruction,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    interrupt(lambda: reconstruct(capture, CONFIG, tmp_path), 37, monkeypatch)
    resumed = reconstruct(capture, CONFIG, tmp_path, resume=True)
    assert_same_bits(resumed.gaussians, corrected.gaussians)
