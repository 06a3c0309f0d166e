"""Captures as Redwood and TUM RGB-D sequences, read back by Open3D, and by evo."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.formats.captures.formats import export_capture
from digs_warp.geometry.rigid import matrix_from_quat_xyzw, rigid
from reference.exported import exported, true_points, with_last_frame
from reference.optional import open3d_or_skip
from reference.recorded import HEIGHT, TIMES, WIDTH


def rows(path: Path) -> list[list[str]]:
    """The words of each line that is no comment."""
    return [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]


def of_redwood(o3d: Any, folder: Path) -> Iterator[tuple[Any, np.ndarray, Path, Path]]:
    intrinsic = o3d.io.read_pinhole_camera_intrinsic(str(folder / "camera_intrinsic.json"))
    assert (intrinsic.width, intrinsic.height) == (WIDTH, HEIGHT)
    poses = o3d.io.read_pinhole_camera_trajectory(str(folder / "trajectory.log")).parameters
    for number, pose in enumerate(poses):
        name = f"{number:05d}.png"
        yield intrinsic, pose.extrinsic, folder / "color" / name, folder / "depth" / name


def of_tum(o3d: Any, folder: Path) -> Iterator[tuple[Any, np.ndarray, Path, Path]]:
    fx, fy, cx, cy = map(float, rows(folder / "calibration.txt")[0])
    intrinsic = o3d.camera.PinholeCameraIntrinsic(WIDTH, HEIGHT, fx, fy, cx, cy)
    lists = (rows(folder / f"{name}.txt") for name in ("groundtruth", "rgb", "depth"))
    for truth, color, depth in zip(*lists, strict=True):
        assert truth[0] == color[0] == depth[0]
        t = np.array(truth[1:], dtype=float)
        extrinsic = np.linalg.inv(rigid(matrix_from_quat_xyzw(t[3:]), t[:3]))
        yield intrinsic, extrinsic, folder / color[1], folder / depth[1]


@pytest.mark.parametrize(
    ("form", "read", "scale", "tolerance"),
    [("redwood", of_redwood, 1000.0, 7e-4), ("tum", of_tum, 5000.0, 1.5e-4)],
)
def test_open3d_gets_the_points_back(
    capture: Capture, tmp_path: Path, form: str, read: Any, scale: float, tolerance: float
) -> None:
    o3d = open3d_or_skip()
    found = list(read(o3d, exported(capture, form, tmp_path)))
    assert len(found) == len(capture)
    for number, (intrinsic, extrinsic, color, depth) in enumerate(found):
        cloud = o3d.geometry.PointCloud.create_from_depth_image(
            o3d.io.read_image(str(depth)),
            *(intrinsic, extrinsic),
            depth_scale=scale,
            depth_trunc=100.0,
        )
        expected = true_points(capture, number)
        np.testing.assert_allclose(np.asarray(cloud.points), expected, atol=tolerance)
        image = np.asarray(o3d.io.read_image(str(color)))
        np.testing.assert_array_equal(image, capture.frames[number].load_image())


def test_evo_reads_the_trajectory(capture: Capture, tmp_path: Path) -> None:
    files = pytest.importorskip("evo.tools.file_interface", reason="evo is not installed")
    folder = exported(capture, "tum", tmp_path)
    found = files.read_tum_trajectory_file(folder / "groundtruth.txt")
    np.testing.assert_allclose(found.timestamps, TIMES)
    expected = [frame.camera.world_from_cam for frame in capture.frames]
    np.testing.assert_allclose(found.poses_se3, expected, atol=1e-6)


def test_tum_needs_times_that_differ(capture: Capture, tmp_path: Path) -> None:
    twice = with_last_frame(capture, time=0.25)
    with pytest.raises(CaptureError, match="several frames share a time"):
        export_capture(twice, "tum", tmp_path / "out")
