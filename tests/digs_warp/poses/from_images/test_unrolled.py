"""COLMAP's models of a rolling shutter, corrected: poses, points, errors, and what is refused."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
import pytest
from scipy.spatial.transform import Rotation

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.poses.from_images.colmap import ImageSet, quiet_pycolmap
from digs_warp.poses.from_images.rolling_shutter import correct_rolling_shutter
from digs_warp.poses.from_images.workspace import sfm_model
from reference.sfm_views import INTRINSICS, arc
from studies.pose_errors import pose_errors

READOUT = 0.02
# Seconds between photographs: the arc is walked at 0.25 m/s.
SPACING = 0.6
COUNT, POINTS = 12, 300


def project(points: np.ndarray) -> np.ndarray:
    k = INTRINSICS
    return points[:, :2] / points[:, 2:] * (k.fx, k.fy) + (k.cx, k.cy)


def pixels(
    points: np.ndarray, before: np.ndarray, now: np.ndarray, after: np.ndarray, spin: np.ndarray
) -> np.ndarray:
    """Where a shaking camera (cam_from_world now, and at its neighbors) sees points row by row."""
    centers = [-pose[:3, :3].T @ pose[:3, 3] for pose in (before, after)]
    walk = now[:3, :3] @ (centers[1] - centers[0]) / (2 * SPACING) * READOUT
    still = points @ now[:3, :3].T + now[:3, 3]
    moments = np.zeros(len(points))
    for _ in range(6):
        turned = Rotation.from_rotvec(moments[:, None] * spin * READOUT).apply(still)
        px = project(turned - moments[:, None] * walk)
        moments = px[:, 1] / INTRINSICS.height - 0.5
    return px


@pytest.fixture
def frames() -> list[Frame]:
    """Frames without files; the first and the last of the arc only tell how the others move."""
    return [
        Frame(
            f"{n:04d}", Camera(INTRINSICS, pose), SPACING * n, {Layer.IMAGE: Path(f"/{n:04d}.png")}
        )
        for n, pose in enumerate(arc(COUNT))
    ]


@pytest.fixture
def rolling(frames: list[Frame]) -> Any:
    """A model with true poses whose features were measured through a rolling shutter, then adjusted."""
    rng = np.random.default_rng(5)
    points = rng.uniform(-0.3, 0.3, (POINTS, 3))
    spins = rng.normal(0.0, 0.15, (COUNT, 3))
    poses = [invert_rigid(frame.camera.world_from_cam) for frame in frames]
    ends = [
        poses[0] @ np.linalg.inv(poses[1]) @ poses[0],
        poses[-1] @ np.linalg.inv(poses[-2]) @ poses[-1],
    ]
    around = [ends[0], *poses, ends[1]]
    model = pycolmap.Reconstruction()
    k = INTRINSICS
    model.add_camera_with_trivial_rig(
        pycolmap.Camera(
            camera_id=1,
            model="PINHOLE",
            width=k.width,
            height=k.height,
            params=[k.fx, k.fy, k.cx, k.cy],
        )
    )
    tracks = [pycolmap.Track() for _ in points]
    for number, frame in enumerate(frames):
        before, now, after = around[number : number + 3]
        px = pixels(points, before, now, after, spins[number])
        image = pycolmap.Image(name=f"{frame.name}.png", camera_id=1, image_id=number + 1)
        image.points2D = pycolmap.Point2DList([pycolmap.Point2D(xy) for xy in px])
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(poses[number][:3]))
        for index, track in enumerate(tracks):
            track.add_element(number + 1, index)
    for point, track in zip(points, tracks, strict=True):
        model.add_point3D(point, track, np.array([200, 100, 50], np.uint8))
    return adjusted_by_colmap(model)


def adjusted_by_colmap(model: Any) -> Any:
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length = options.refine_extra_params = options.print_summary = False
    quiet_pycolmap().bundle_adjustment(model, options)
    model.update_point_3d_errors()
    return model


def center_error(model: Any, frames: Sequence[Frame]) -> float:
    found = sfm_model(model, frames, ImageSet.of(frames))
    return float(np.median(pose_errors(found, frames).centers_m))


def test_a_model_of_a_rolling_shutter_gets_right(rolling: Any, frames: list[Frame]) -> None:
    before, error = center_error(rolling, frames), rolling.points3D[1].error
    measured = [point.xy.copy() for point in rolling.images[3].points2D]
    correct_rolling_shutter(rolling, frames, ImageSet.of(frames), READOUT)
    assert center_error(rolling, frames) < 0.4 * before
    assert 0 < rolling.points3D[1].error < 0.4 * error
    kept = [point.xy for point in rolling.images[3].points2D]
    np.testing.assert_array_equal(kept, measured)  # depth is looked up where features were measured


def test_wrong_matches_do_not_pull(rolling: Any, frames: list[Frame]) -> None:
    rng, before = np.random.default_rng(3), center_error(rolling, frames)
    for image in rolling.images.values():
        for number in rng.choice(POINTS, POINTS // 20, replace=False):
            image.points2D[number].xy += rng.uniform(-30.0, 30.0, 2)
    correct_rolling_shutter(rolling, frames, ImageSet.of(frames), READOUT)
    assert center_error(rolling, frames) < 0.5 * before


def test_times_that_do_not_rise_are_named(rolling: Any, frames: list[Frame]) -> None:
    frames[4] = replace(frames[4], time=frames[3].time)
    with pytest.raises(
        DigsError, match=r"'0004' was taken at 1.8 s.*later than '0003'.*readout-time"
    ):
        correct_rolling_shutter(rolling, frames, ImageSet.of(frames), READOUT)
