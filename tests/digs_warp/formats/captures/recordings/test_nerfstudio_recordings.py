"""nerfstudio folders, ours and as others write them."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.images import read_image, write_image
from digs_warp.formats.captures.formats import read_recording
from digs_warp.formats.captures.lens import Lens
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.record.files import to_json
from reference.handed_in import nerfstudio
from reference.recorded import WIDTH, check_same, converted


def test_our_own_folder_is_a_nerfstudio_recording(capture: Capture, tmp_path: Path) -> None:
    check_same(converted("nerfstudio", capture.folder, tmp_path), capture, 1e-12)


BROKEN_POSES: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]] = {
    "lost": (lambda pose: pose * np.nan, "1 of 9 frames have no pose and are left out"),
    "zeros": (lambda pose: pose * 0, "1 of 9 frames have no pose and are left out"),
    "scaled": (
        lambda pose: pose @ np.diag([1.3, 1.3, 1.3, 1]),
        "1 frame of 9 with a broken pose .*stretch by .1.3 1.3 1.3",
    ),
    "mirrored": (lambda pose: pose @ np.diag([-1, 1, 1, 1]), "they mirror"),
}


@pytest.mark.parametrize("name", BROKEN_POSES)
def test_a_single_broken_pose_costs_one_frame(
    capture: Capture, tmp_path: Path, caplog, name: str
) -> None:
    change, message = BROKEN_POSES[name]
    index = nerfstudio(capture, tmp_path / "ns")
    frames = [dict(frame) for frame in index["frames"] * 3]
    frames[4]["transform_matrix"] = change(np.array(frames[4]["transform_matrix"])).tolist()
    index["frames"] = frames
    (tmp_path / "ns/transforms.json").write_text(json.dumps(index))
    found = converted("nerfstudio", tmp_path / "ns", tmp_path / "capture")
    assert len(found) == 8 and found.knows_poses
    assert re.search(message, caplog.text)
    if name == "scaled":  # a quarter of them is a mistake in all
        (tmp_path / "ns/transforms.json").write_text(json.dumps(index | {"frames": frames[3:6]}))
        with pytest.raises(CaptureError, match="no rotation: they stretch"):
            converted("nerfstudio", tmp_path / "ns", tmp_path / "many")


def test_the_scale_that_nerfstudio_applied_is_taken_back(capture: Capture, tmp_path: Path) -> None:
    index = nerfstudio(capture, tmp_path / "ns")
    for frame in index["frames"]:
        for row in frame["transform_matrix"][:3]:
            row[:] = np.round([*row[:3], 0.25 * row[3]], 6).tolist()  # scanners write few digits
    (tmp_path / "ns/transforms.json").write_text(to_json(index | {"applied_scale": 0.25}))
    found = converted("nerfstudio", tmp_path / "ns", tmp_path / "capture")
    centers = [frame.camera.center_world for frame in found.frames]
    expected = [frame.camera.center_world for frame in capture.frames]
    np.testing.assert_allclose(centers, expected, atol=1e-5)


def test_synthetic_scenes_have_a_field_of_view_and_no_suffixes(
    capture: Capture, tmp_path: Path
) -> None:
    folder = tmp_path / "synthetic"
    entries = []
    for number, frame in enumerate(capture.frames):
        write_image(
            folder / f"train/r_{number}.png", np.dstack([frame.load_image(), frame.load_mask()])
        )
        matrix = (frame.camera.world_from_cam @ OPENCV_FROM_OPENGL).tolist()
        entries.append({"file_path": f"./train/r_{number}", "transform_matrix": matrix})
    (folder / "transforms.json").write_text(to_json({"camera_angle_x": 0.7, "frames": entries}))
    found = converted("nerfstudio", folder, tmp_path / "capture")
    k = found.frames[0].camera.intrinsics
    assert k.fx == pytest.approx(0.5 * WIDTH / np.tan(0.35)) and (k.cx, k.cy) == (10.5, 7.0)
    np.testing.assert_array_equal(found.frames[0].load_image(), capture.frames[0].load_image())
    np.testing.assert_array_equal(found.frames[0].load_mask(), capture.frames[0].load_mask())


def test_a_fisheye_lens_is_taken_out(capture: Capture, tmp_path: Path) -> None:
    lens = {"k1": 0.05, "k2": 0.01, "k3": 0.0, "k4": 0.0}
    nerfstudio(capture, tmp_path / "named", camera_model="OPENCV_FISHEYE", **lens)
    nerfstudio(capture, tmp_path / "said", is_fisheye=True, **lens)
    named, said = (
        converted("nerfstudio", tmp_path / name, tmp_path / f"{name} capture")
        for name in ("named", "said")
    )
    view = read_recording(tmp_path / "named", "nerfstudio").frames[0].view
    assert view is not None and view.lens == Lens((0.05, 0.01, 0.0, 0.0), is_fisheye=True)
    found = named.frames[0].load_image()
    np.testing.assert_array_equal(found, said.frames[0].load_image())
    recorded = read_image(tmp_path / "named/images/0000.png")
    np.testing.assert_array_equal(found, view.apply(recorded))
    assert (found != recorded).any()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"camera_model": "OPENCV_FISHEYE", "p1": 0.1}, "OPENCV_FISHEYE with p1, expected only k1"),
        ({"camera_model": "EQUIRECTANGULAR"}, "camera_model is 'EQUIRECTANGULAR', expected one of"),
        ({"k1": 1e9}, "show 0% of the pinhole images"),
        ({"k1": 0.1, "w": 48 * 10**9}, "its camera: 672,000,000,000 pixels, expected up to"),
        ({"camera_model": "OPENCV", "k1": 0.1, "k5": 0.01}, "OPENCV with k5, expected only k1, k2"),
        ({"k1": "much"}, "frame 0 .*k1 is 'much', expected a finite number"),
        ({"depth_unit_scale_factor": -1}, "depth_unit_scale_factor is -1"),
        ({"frames": []}, "lists no frames"),
        ({"w": 640, "h": 480}, r"21x14 pixels, expected 640x480 .*give the camera of these images"),
        ({"w": 14, "h": 21}, r"21x14 pixels, expected 14x21 .*on its side.*-auto-orient"),
        ({"fl_x": -3.0}, "expected pixels above 0"),
        ({"fl_x": "wide"}, "frame 0"),
    ],
)
def test_nerfstudio_folders_that_cannot_be_used(
    capture: Capture, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    nerfstudio(capture, tmp_path / "ns", **changes)
    with pytest.raises(DigsError, match=message):
        converted("nerfstudio", tmp_path / "ns", tmp_path / "capture")


def test_a_fourth_radial_coefficient_goes_with_the_eighth_power(
    capture: Capture, tmp_path: Path
) -> None:
    nerfstudio(capture, tmp_path / "ns", k1=0.1, k2=-0.02, k3=0.003, k4=0.4)
    view = read_recording(tmp_path / "ns", "nerfstudio").frames[0].view
    assert view is not None and view.lens is not None
    x, y = 0.5, -0.3
    square = x**2 + y**2
    factor = 1 + 0.1 * square - 0.02 * square**2 + 0.003 * square**3 + 0.4 * square**4
    bent = view.lens.distort(np.array([2 * x, 2 * y, 2.0]))
    np.testing.assert_allclose(bent, [x * factor, y * factor], rtol=1e-12)
    # The model that is OpenCV's own has it in the denominator.
    nerfstudio(capture, tmp_path / "full", camera_model="FULL_OPENCV", k1=0.1, k4=0.4, k6=0.2)
    view = read_recording(tmp_path / "full", "nerfstudio").frames[0].view
    assert view is not None and view.lens == Lens((0.1, 0, 0, 0, 0, 0.4, 0, 0.2))
