"""ScanNet, Record3D and ZED, written here as their exporters write them, and real images."""

import json
import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.data.images import write_image
from digs_warp.formats.captures.formats import read_recording
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL, quat_xyzw_from_matrix
from digs_warp.record.files import to_json
from reference.recorded import HEIGHT, WIDTH, check_same, converted


def write_scannet(capture: Capture, folder: Path) -> None:
    """Depth of twice the size, by its own camera; the pose of the second frame is lost."""
    for part in ("color", "depth", "pose", "intrinsic"):
        (folder / part).mkdir(parents=True)
    for number, frame in enumerate(capture.frames):
        write_image(folder / f"color/{number}.png", frame.load_image())
        depth = np.nan_to_num(frame.load_depth()).repeat(2, axis=0).repeat(2, axis=1)
        write_image(folder / f"depth/{number}.png", np.round(depth * 1000).astype(np.uint16))
        pose = frame.camera.world_from_cam if number != 1 else np.full((4, 4), -np.inf)
        np.savetxt(folder / f"pose/{number}.txt", pose)
    matrix = np.eye(4)
    matrix[:2, :3] = [[19.0, 0, 9.25 - 0.5], [0, 23.0, 7.75 - 0.5]]
    np.savetxt(folder / "intrinsic/intrinsic_color.txt", matrix)
    matrix[:2, :3] = [[38.0, 0, 18.5 - 0.5], [0, 46.0, 15.5 - 0.5]]
    np.savetxt(folder / "intrinsic/intrinsic_depth.txt", matrix)


def test_scannet_depth_lands_on_the_color_pixels(
    capture: Capture, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_scannet(capture, tmp_path / "scannet")
    with caplog.at_level(logging.WARNING):
        found = converted("scannet", tmp_path / "scannet", tmp_path / "capture")
    assert "1 of 3 frames have no pose" in caplog.text
    check_same(found, replace(capture, frames=capture.frames[::2]), 1e-3)


def write_record3d(capture: Capture, folder: Path) -> None:
    k = np.array([[19.0, 0, 9.25], [0, 23.0, 7.75], [0, 0, 1]])
    poses = []
    for number, frame in enumerate(capture.frames):
        matrix = frame.camera.world_from_cam @ OPENCV_FROM_OPENGL
        poses.append([*quat_xyzw_from_matrix(matrix[:3, :3]), *matrix[:3, 3]])
        write_image(folder / f"EXR_RGBD/rgb/{number}.png", frame.load_image())
        write_image(folder / f"EXR_RGBD/depth/{number}.exr", frame.load_depth())
    metadata = {"K": k.T.ravel(), "w": WIDTH, "h": HEIGHT, "fps": 30, "poses": np.array(poses)}
    (folder / "metadata.json").write_text(to_json(metadata))


def test_record3d_poses_have_opengl_axes(capture: Capture, tmp_path: Path) -> None:
    write_record3d(capture, tmp_path / "r3d")
    found = converted("record3d", tmp_path / "r3d", tmp_path / "capture")
    check_same(found, capture, 1e-6)
    assert found.frames[2].time == pytest.approx(2 / 30)


@pytest.mark.parametrize("kind", ["millimetres", "metres"])
def test_zed_frames_have_depth_codes_but_no_poses(
    capture: Capture, tmp_path: Path, kind: str
) -> None:
    folder = tmp_path / "zed"
    for number, frame in enumerate(capture.frames):
        write_image(folder / f"left{number:06d}.png", frame.load_image())
        write_image(folder / f"right{number:06d}.png", frame.load_image()[:, ::-1].copy())
        depth = frame.load_depth()
        if kind == "millimetres":
            write_image(
                folder / f"depth{number:06d}.png",
                np.round(np.nan_to_num(depth) * 1000).astype(np.uint16),
            )
        else:
            coded = depth.copy()
            coded[0, :3] = [np.nan, np.inf, -np.inf]
            np.save(folder / f"depth{number:06d}.npy", coded)
    calibration = {"fx": 19.0, "fy": 23.0, "cx": 9.25, "cy": 7.75, "baseline": 0.12}
    (folder / "calibration.json").write_text(json.dumps(calibration))
    found = converted("zed", folder, tmp_path / "capture")
    assert not found.knows_poses and capture.knows_poses
    assert found.rig is not None and found.rig.baseline == 0.12
    for frame, true in zip(found.frames, capture.frames, strict=True):
        expected = true.load_depth()
        if kind == "metres":
            expected[0, :3] = np.nan
        np.testing.assert_allclose(frame.load_depth(), expected, atol=6e-4)
        np.testing.assert_array_equal(frame.load_right_image(), true.load_image()[:, ::-1])
        np.testing.assert_array_equal(frame.camera.world_from_cam, np.eye(4))


def test_a_baseline_in_millimetres_is_refused(capture: Capture, tmp_path: Path) -> None:
    folder = tmp_path / "zed"
    for eye in ("left", "right"):
        write_image(folder / f"{eye}000000.png", capture.frames[0].load_image())
    calibration = {"fx": 19.0, "fy": 23.0, "cx": 9.25, "cy": 7.75, "baseline": 119.987}
    (folder / "calibration.json").write_text(json.dumps(calibration))
    with pytest.raises(
        CaptureError, match=r"baseline is 119\.987, expected metres.* write 0\.119987"
    ):
        read_recording(folder, "zed")
