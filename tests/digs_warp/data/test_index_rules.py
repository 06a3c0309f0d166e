"""What transforms.json says about cameras, units and versions is honored or refused, never skipped."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import CaptureError
from digs_warp.data.capture import read_capture
from digs_warp.data.images import write_image
from digs_warp.data.index_rules import CAMERA_MODELS, COEFFICIENTS
from digs_warp.formats.captures.formats import read_recording
from reference.noise_capture import change_frame, change_index, write_capture

CONVERT = "'digs-warp convert FOLDER --from nerfstudio --out CAPTURE' removes it"

REFUSED: list[tuple[dict[str, Any], str]] = [
    *(({key: 0.01}, f"PINHOLE with {key}=0.01, expected images without .*{CONVERT}") for key in COEFFICIENTS),
    ({"camera_model": "OPENCV", "k1": -0.03}, f"OPENCV with k1=-0.03.*{CONVERT}"),
    ({"camera_model": "OPENCV_FISHEYE"}, f"OPENCV_FISHEYE with no coefficients.*{CONVERT}"),
    ({"camera_model": "EQUIRECTANGULAR"}, "'EQUIRECTANGULAR', expected one of PINHOLE.*image_undistorter"),
    ({"camera_model": 7}, "camera_model is 7"),
    ({"is_fisheye": True}, f"OPENCV_FISHEYE with no coefficients.*{CONVERT}"),
    ({"is_fisheye": "no"}, "is_fisheye is 'no', expected true or false"),
    ({"k1": "much"}, "k1 is 'much', expected a finite number"),
    ({"k1": float("nan")}, "k1 is nan"),
    ({"applied_scale": 0.25}, f"applied_scale is 0.25, expected 1.*{CONVERT}"),
    ({"depth_unit_scale_factor": 0.001}, "is 0.001, expected 1 for 'depth/0000.exr'"),
    ({"depth_unit_scale_factor": "mm"}, "is 'mm', expected 1"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "complaint"), REFUSED, ids=str)
def test_what_no_capture_may_say_is_refused_for_all_frames_and_for_one(
    tmp_path: Path, changes: dict[str, Any], complaint: str
) -> None:
    write_capture(tmp_path, 2)
    change_frame(tmp_path, 0, **changes)
    with pytest.raises(CaptureError, match=f"frame 0 in transforms.json: .*{complaint}"):
        read_capture(tmp_path)
    write_capture(tmp_path, 2)
    change_index(tmp_path, **changes)
    with pytest.raises(CaptureError, match=f"frame 0 in transforms.json: .*{complaint}"):
        read_capture(tmp_path)


@pytest.mark.parametrize("model", CAMERA_MODELS)
def test_every_model_passes_with_zero_coefficients(tmp_path: Path, model: str) -> None:
    write_capture(tmp_path, 2)
    zeros = dict.fromkeys(COEFFICIENTS, 0.0)
    change_index(tmp_path, camera_model=model, is_fisheye=False, applied_scale=1.0, **zeros)
    assert len(read_capture(tmp_path)) == 2


def test_what_has_no_effect_on_a_capture_passes(tmp_path: Path) -> None:
    write_capture(tmp_path, 2)
    change_index(
        tmp_path,
        depth_unit_scale_factor=1.0,
        applied_transform=np.eye(4)[:3].tolist(),
        ply_file_path="sparse_pc.ply",
    )
    assert len(read_capture(tmp_path)) == 2


@pytest.mark.parametrize(
    ("ours", "complaint"),
    [
        (
            {"format_version": 99},
            "99, written by a newer digs-warp; this one reads up to 1. Update",
        ),
        ({"format_version": "1"}, "format_version is '1', expected 1"),
        ({"format_version": 0}, "format_version is 0, expected 1"),
        ({"format_version": True}, "format_version is True, expected 1"),
        ({"depth_unit": "millimetre"}, "depth_unit is 'millimetre', expected 'metre'"),
    ],
    ids=str,
)
def test_another_version_or_unit_is_refused(
    tmp_path: Path, ours: dict[str, Any], complaint: str
) -> None:
    write_capture(tmp_path, 1)
    change_index(tmp_path, digs_warp=ours)
    with pytest.raises(CaptureError, match=rf"digs_warp in transforms.json: .*{complaint}"):
        read_capture(tmp_path)
    with pytest.raises(CaptureError, match=rf"digs_warp in transforms.json: .*{complaint}"):
        read_recording(tmp_path, "nerfstudio")


def test_a_unit_of_depth_beside_our_section_is_refused_too(tmp_path: Path) -> None:
    write_capture(tmp_path, 1)
    change_index(tmp_path, depth_unit="mm")
    for read in (read_capture, lambda folder: read_recording(folder, "nerfstudio")):
        with pytest.raises(
            CaptureError, match=r"frame 0 .*transforms\.json: depth_unit is 'mm', expected"
        ):
            read(tmp_path)


def test_unknown_keys_of_our_section_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_capture(tmp_path, 1)
    change_index(tmp_path, digs_warp={"pose_known": False, "weather": "rain"})
    read_capture(tmp_path)
    assert "unknown key 'pose_known' has no effect; did you mean 'poses_known'?" in caplog.text
    assert "unknown key 'weather' has no effect; expected one of format_version" in caplog.text


def test_the_index_that_we_write_draws_no_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_capture(tmp_path, 1)
    assert caplog.text == ""


def test_sixteen_bits_of_depth_need_the_factor_of_millimetres(tmp_path: Path) -> None:
    write_capture(tmp_path, 1)
    write_image(tmp_path / "depth/0000.png", np.full((9, 12), 5000, np.uint16))
    change_frame(tmp_path, 0, depth_file_path="depth/0000.png", depth_unit_scale_factor=0.001)
    assert read_capture(tmp_path).frames[0].load_depth()[0, 0] == 5.0
    change_frame(tmp_path, 0, depth_unit_scale_factor=0.0002)
    with pytest.raises(CaptureError, match=r"0.0002, expected 0.001 .*converts other images"):
        read_capture(tmp_path)
    frame = read_recording(tmp_path, "nerfstudio").frames[0]
    assert frame.depth_units_per_metre == pytest.approx(5000)
