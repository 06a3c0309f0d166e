"""What our exporters write comes back; broken files and unknown forms are named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.formats import READERS, export_capture, read_recording
from digs_warp.geometry.camera import Camera
from reference.recorded import check_same, converted


@pytest.mark.parametrize(
    ("form", "tolerance"),
    [("tum", 2e-4), ("redwood", 1e-3), ("bop", 2e-4), ("nerfstudio", 1e-3)],
)
def test_exports_come_back_as_the_same_points(
    capture: Capture, form: str, tolerance: float, tmp_path: Path
) -> None:
    export_capture(capture, form, tmp_path / form)
    found = converted(form, tmp_path / form, tmp_path / "capture")
    check_same(found, capture, tolerance)
    assert found.knows_poses


def test_masks_and_cameras_of_bop_come_back(capture: Capture, tmp_path: Path) -> None:
    zoomed = replace(capture.frames[2].camera.intrinsics, fx=30.0)
    last = replace(
        capture.frames[2], camera=Camera(zoomed, capture.frames[2].camera.world_from_cam)
    )
    export_capture(replace(capture, frames=(*capture.frames[:2], last)), "bop", tmp_path / "bop")
    found = converted("bop", tmp_path / "bop", tmp_path / "capture")
    assert [frame.camera.intrinsics.fx for frame in found.frames] == [19.0, 19.0, 30.0]
    np.testing.assert_array_equal(found.frames[1].load_mask(), capture.frames[1].load_mask())


@pytest.mark.parametrize("form", READERS)
def test_an_empty_folder_is_no_recording(form: str, tmp_path: Path) -> None:
    with pytest.raises(DigsError, match=str(tmp_path)):
        read_recording(tmp_path, form)
    with pytest.raises(CaptureError, match="no such folder"):
        read_recording(tmp_path / "missing", form)
    (tmp_path / "walk.mp4").write_bytes(b"film")
    with pytest.raises(CaptureError, match=r"expected a folder, found a file.*--from video"):
        read_recording(tmp_path / "walk.mp4", form)


def test_tum_needs_to_know_its_camera(capture: Capture, tmp_path: Path) -> None:
    export_capture(capture, "tum", tmp_path / "rgbd_dataset_freiburg2_desk")
    (tmp_path / "rgbd_dataset_freiburg2_desk/calibration.txt").unlink()
    recording = read_recording(tmp_path / "rgbd_dataset_freiburg2_desk", "tum")
    assert recording.frames[0].intrinsics.fx == 520.9
    (tmp_path / "rgbd_dataset_freiburg2_desk").rename(tmp_path / "mine")
    with pytest.raises(CaptureError, match=r"write 'fx fy cx cy' into its calibration\.txt"):
        read_recording(tmp_path / "mine", "tum")


@pytest.mark.parametrize("name", ["depth.txt", "groundtruth.txt"])
def test_tum_times_that_match_nothing_are_an_error(
    capture: Capture, tmp_path: Path, name: str
) -> None:
    export_capture(capture, "tum", tmp_path / "tum")
    shift_times(tmp_path / "tum" / name, 3600.0)
    with pytest.raises(CaptureError, match=rf"{name}': none of 3 .* nearest are 3.6e\+03 s away"):
        read_recording(tmp_path / "tum", "tum")


def test_tum_images_without_depth_are_counted(
    capture: Capture, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    export_capture(capture, "tum", tmp_path / "tum")
    path = tmp_path / "tum/depth.txt"
    path.write_text("\n".join(path.read_text().splitlines()[:-1]))
    found = converted("tum", tmp_path / "tum", tmp_path / "capture")
    assert [frame.has(Layer.DEPTH) for frame in found.frames] == [True, True, False]
    assert "1 of 3 images have no depth of the same moment, to 20 ms" in caplog.text


def shift_times(path: Path, seconds: float) -> None:
    lines = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    moved = [" ".join([f"{float(time) + seconds:.6f}", *rest]) for time, *rest in lines]
    path.write_text("\n".join(moved))


@pytest.mark.parametrize(
    ("form", "name", "content", "message"),
    [
        ("tum", "rgb.txt", "no numbers here\n", "lines of time and file name"),
        ("tum", "groundtruth.txt", "1 2 3\n", "poses"),
        ("redwood", "camera_intrinsic.json", "{}", "intrinsic_matrix"),
        ("redwood", "trajectory.log", "0 0 1\n1 0 0\n", "trajectory"),
        ("bop", "train/000000/scene_camera.json", "{}", "has no '0'"),
    ],
)
def test_broken_files_are_named(
    capture: Capture, tmp_path: Path, form: str, name: str, content: str, message: str
) -> None:
    export_capture(capture, form, tmp_path)
    (tmp_path / name).write_text(content)
    with pytest.raises(DigsError, match=message):
        read_recording(tmp_path, form)
