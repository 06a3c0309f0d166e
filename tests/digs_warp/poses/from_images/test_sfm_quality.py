"""What the quality report says of models that are made by hand, and which models are refused."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.sfm_model import Observations, SfmModel
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.poses.from_images.quality import (
    SfmQuality,
    check_agreement,
    check_completeness,
    check_motion,
    measure_quality,
)
from reference.sfm_views import arc, record

UP = np.array([0.0, 0.0, 1.0])
GOOD = SfmQuality(
    images=100, registered=100, models=1, points=5000, observations_per_image=200.0,
    track_length=4.0, reprojection_error_px=0.2,
)  # fmt: skip


def model_from(eyes: np.ndarray, points: np.ndarray) -> SfmModel:
    """Every camera looks along x and sees every point."""
    intrinsics = Intrinsics.from_fov(640, 480, 60.0)
    cameras = tuple(Camera(intrinsics, look_at(eye, eye + [1.0, 0.0, 0.0], UP)) for eye in eyes)
    who, what = np.meshgrid(np.arange(len(eyes)), np.arange(len(points)), indexing="ij")
    px = np.concatenate([camera.project(points)[0] for camera in cameras])
    return SfmModel(
        tuple(f"{i:04d}" for i in range(len(eyes))),
        cameras,
        PointCloud(points, np.zeros_like(points)),
        Observations(who.ravel(), what.ravel(), px),
        np.arange(len(points), dtype=np.float32),
    )


POINTS = np.array([[2.0, y, z] for y in (-0.3, 0.0, 0.3) for z in (-0.3, 0.3)])


def test_the_numbers_are_those_of_the_model() -> None:
    model = model_from(np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.5]]), POINTS)
    seen = model.observations  # one of them less
    fewer = Observations(seen.cameras[:-1], seen.points[:-1], seen.px[:-1])
    quality = measure_quality(replace(model, observations=fewer), images=5, models=2)
    assert (quality.images, quality.registered, quality.models, quality.points) == (5, 3, 2, 6)
    assert quality.observations_per_image == pytest.approx(17 / 3)
    assert quality.track_length == pytest.approx(17 / 6)
    assert quality.reprojection_error_px == pytest.approx(40 / 17)


def test_models_with_too_few_of_the_images_are_refused(caplog: pytest.LogCaptureFixture) -> None:
    check_completeness(GOOD, min_registered=1.0)
    assert caplog.text == ""
    check_completeness(replace(GOOD, registered=93, models=2), min_registered=0.9)
    assert "93 of 100 images" in caplog.text
    said = r"largest of 3 models holds 48 of 100.*--min-registered 0\.48"
    with pytest.raises(DigsError, match=said):
        check_completeness(replace(GOOD, registered=48, models=3), min_registered=0.9)


def test_given_poses_with_few_points_are_refused_unless_matches_agree_with_them(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    frames = record(arc(4, 60.0), tmp_path).frames
    turned = [replace(f, camera=replace(f.camera, world_from_cam=p)) for f, p in _exchanged(frames)]
    few = replace(GOOD, points=30, observations_per_image=0.6)
    check_agreement(GOOD, turned)
    check_agreement(few, frames)
    assert "of their matches agree with the poses" in caplog.text
    for wrong in (turned, []):
        with pytest.raises(DigsError, match="share only 30 points"):
            check_agreement(few, wrong)


def _exchanged(frames: Sequence[Frame]) -> list[tuple[Frame, np.ndarray]]:
    """Each frame with the pose of another one."""
    return [
        (frames[i], frames[j].camera.world_from_cam) for i, j in ((0, 2), (1, 0), (2, 3), (3, 1))
    ]


def test_cameras_on_a_straight_line_are_refused() -> None:
    eyes = np.stack([np.zeros(9), np.linspace(-0.5, 0.5, 9), np.zeros(9)], axis=1)
    with pytest.raises(DigsError, match="straight line"):
        check_motion(model_from(eyes, POINTS))
    eyes[:, 2] = 0.05 * np.linspace(-1, 1, 9) ** 2  # a hand is never as straight
    check_motion(model_from(eyes, POINTS))


def test_cameras_that_only_turned_are_refused() -> None:
    eyes = 0.005 * np.random.default_rng(0).normal(size=(9, 3))
    with pytest.raises(DigsError, match="turned on the spot"):
        check_motion(model_from(eyes, POINTS))
    check_motion(model_from(20 * eyes, POINTS))
