"""Photographs of constant exposure are trained as they are; others are not."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.pipeline.optimize import pose_training
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.poses.outcome import PoseRefinement
from digs_warp.train.config import Stop, TrainConfig

USUAL = TrainConfig(stop=Stop(iterations=20))


def trained(tiny_capture: Capture, folder: Path, train: TrainConfig = USUAL) -> Reconstruction:
    return reconstruct(tiny_capture, ReconstructConfig(train=train), folder)


def test_constant_exposure_is_not_fitted(tiny_capture: Capture, tmp_path: Path) -> None:
    fitted = trained(tiny_capture, tmp_path / "on")
    assert fitted.training.exposure_stops == 0.0
    without = trained(tiny_capture, tmp_path / "off", replace(USUAL, fit_exposure="off"))
    assert without.training.exposure_stops is None
    np.testing.assert_array_equal(fitted.gaussians.sh, without.gaussians.sh)


def test_exposures_are_fitted_where_they_vary(tiny_capture: Capture, tmp_path: Path) -> None:
    frames = []
    for number, frame in enumerate(tiny_capture.frames):
        image = np.rint(frame.load_image() * (0.7 + 0.3 * np.cos(0.5 * number)))
        frames.append(frame.with_layer(Layer.IMAGE, image.astype(np.uint8)))
    uneven = trained(replace(tiny_capture, frames=tuple(frames)), tmp_path / "uneven")
    assert uneven.training.exposure_stops and uneven.training.exposure_stops > 0.3


def test_cameras_of_a_bundle_adjustment_are_only_turned() -> None:
    aligned = PoseRefinement(True, "", in_training=True)
    assert pose_training(aligned) == "moved"
    assert pose_training(replace(aligned, adjusted=True)) == "turned"
    assert pose_training(replace(aligned, in_training=False)) == pose_training(None) == "held"
