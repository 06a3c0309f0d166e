"""Captures as Redwood sequences, read back by Open3D."""

from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from reference.exported import exported, true_points
from reference.optional import open3d_or_skip
from reference.recorded import HEIGHT, WIDTH


def test_open3d_gets_the_points_back_from_redwood(capture: Capture, tmp_path: Path) -> None:
    o3d = open3d_or_skip()
    folder = exported(capture, "redwood", tmp_path)
    intrinsic = o3d.io.read_pinhole_camera_intrinsic(str(folder / "camera_intrinsic.json"))
    assert (intrinsic.width, intrinsic.height) == (WIDTH, HEIGHT)
    trajectory = o3d.io.read_pinhole_camera_trajectory(str(folder / "trajectory.log"))
    assert len(trajectory.parameters) == len(capture)
    for number, parameters in enumerate(trajectory.parameters):
        depth = o3d.io.read_image(str(folder / f"depth/{number:05d}.png"))
        cloud = o3d.geometry.PointCloud.create_from_depth_image(
            depth, intrinsic, parameters.extrinsic, depth_scale=1000.0, depth_trunc=100.0
        )
        np.testing.assert_allclose(
            np.asarray(cloud.points), true_points(capture, number), atol=7e-4
        )
        color = np.asarray(o3d.io.read_image(str(folder / f"color/{number:05d}.png")))
        np.testing.assert_array_equal(color, capture.frames[number].load_image())
