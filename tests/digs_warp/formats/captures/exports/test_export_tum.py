"""Captures as TUM RGB-D sequences, read back by Open3D and by the specification."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.formats.captures.formats import export_capture
from digs_warp.geometry.rigid import matrix_from_quat_xyzw, rigid
from reference.exported import (
    exported,
    true_points,
    with_last_frame,
)
from reference.optional import open3d_or_skip
from reference.recorded import HEIGHT, TIMES, WIDTH


def rows(path: Path) -> list[list[str]]:
    """The words of each line that is no comment."""
    return [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]


def test_open3d_gets_the_points_back_from_tum(capture: Capture, tmp_path: Path) -> None:
    o3d = open3d_or_skip()
    folder = exported(capture, "tum", tmp_path)
    fx, fy, cx, cy = map(float, rows(folder / "calibration.txt")[0])
    intrinsic = o3d.camera.PinholeCameraIntrinsic(WIDTH, HEIGHT, fx, fy, cx, cy)
    colors = [folder / row[1] for row in rows(folder / "rgb.txt")]
    depths = [folder / row[1] for row in rows(folder / "depth.txt")]
    for number, row in enumerate(rows(folder / "groundtruth.txt")):
        t = np.array(row[1:], dtype=float)
        extrinsic = np.linalg.inv(rigid(matrix_from_quat_xyzw(t[3:]), t[:3]))
        depth = o3d.io.read_image(str(depths[number]))
        cloud = o3d.geometry.PointCloud.create_from_depth_image(
            depth, intrinsic, extrinsic, depth_scale=5000.0, depth_trunc=100.0
        )
        # A step of 0.2 mm, seen at up to 30 degrees from the axis.
        np.testing.assert_allclose(
            np.asarray(cloud.points), true_points(capture, number), atol=1.5e-4
        )
        color = np.asarray(o3d.io.read_image(str(colors[number])))
        np.testing.assert_array_equal(color, capture.frames[number].load_image())


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
