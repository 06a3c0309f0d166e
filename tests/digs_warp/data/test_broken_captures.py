"""Every way in which a capture folder can be broken, and what the error names; nothing is skipped."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.data.capture import read_capture
from digs_warp.data.images import write_image
from digs_warp.data.index_rules import CAMERA_MODELS, COEFFICIENTS
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.formats import read_recording
from reference.noise_capture import change_frame, change_index, write_capture

CONVERT = "'digs-warp convert FOLDER --from nerfstudio --out CAPTURE' removes it"

Cases = list[tuple[Any, str]]

INDEX: Cases = [
    *(({"frames": value}, "lists no frames") for value in (None, [], {}, "0000")),
    ({"frames": ["images/0000.png"]}, "frame 0"),
    ({"cx": 1e6}, "frame 0: cx is .*expected pixels from -"),
    ({"cy": -1e3}, "frame 0: cy is .*expected pixels from -"),
    *(({key: None}, f"frame 0: .*has no '{key}'") for key in ("w", "h", "fl_x", "fl_y", "cx", "cy")),
    ({"depth_unit": "mm"}, "frame 0 .*: depth_unit is 'mm', expected"),
]  # fmt: skip

EYES = {"offset": 0, "fl_x": 1, "fl_y": 1, "cx": 1, "cy": 1}
SECTION: Cases = [
    ([], ": expected a JSON object"),
    ({"poses_known": "no"}, ": poses_known is 'no', expected true or false"),
    ({"readout_time": -1.0}, ": readout_time is -1.0, expected seconds"),
    ({"seed": 0.5}, ": seed is 0.5, expected an integer"),
    ({"object_radius": True}, ": object_radius is True, expected metres"),
    ({"world_from_mesh": [[1, 0, 0, 0]] * 4}, ": world_from_mesh is .*, expected 4 rows of 4"),
    ({"world_from_mesh": "unit"}, ": world_from_mesh is .*, expected 4 rows of 4 numbers"),
    ({"objects": []}, r": objects is \[\], expected a list of objects with name"),
    ({"objects": [{"name": "mug", "size": [1, 1, 1]}]}, ", objects 0: has no 'world_from_mesh'"),
    ({"effects": "blur"}, ": effects is 'blur', expected a list of names"),
    ({"cause_labels": {"dark": "occluded"}}, ": cause_labels is .*expected names by number"),
    ({"sensor": 0.12}, ": sensor is 0.12, expected an object"),
    *(({"rig": rig}, ", rig: ") for rig in ({}, {"baseline": "wide"}, {"baseline": -1}, None, 3)),
    *(({"rig": {"baseline": 0.1, "infrared": pair}}, f", rig, infrared: {message}") for pair, message in (
        ({"offset": 0.015}, "has no 'fl_x'"),
        ([1], "expected a JSON object"),
        (EYES | {"offset": "x"}, "offset is 'x', expected a finite"),
        (EYES | {"fl_x": 0}, "fl_x is 0, expected pixels above 0"),
    )),
    ({"format_version": 99}, ": .*99, written by a newer digs-warp; this one reads up to 1. Update"),
    *(({"format_version": bad}, f": format_version is {bad!r}, expected 1") for bad in ("1", 0, True)),
    ({"depth_unit": "millimetre"}, ": depth_unit is 'millimetre', expected 'metre'"),
]  # fmt: skip

FRAME: Cases = [
    *(({"transform_matrix": value}, "") for value in (
        None, [[1, 0], [0, 1]], "identity", np.diag([2.0, 2, 2, 1]).tolist(),
        np.diag([-1.0, 1, 1, 1]).tolist(), np.full((4, 4), np.nan).tolist(),
    )),
    *(({key: value}, "") for key, value in (
        ("file_path", None), ("file_path", 7), ("time", "noon"), ("w", "wide"), ("w", 12.5), ("fl_x", -3.0),
        ("camera_motion", "fast"),
    )),
    ({"exposure_time": -0.1}, "exposure_time is -0.1, expected seconds, 0 or more"),
    ({"camera_motion": {"velocity": [0, 0, 0]}}, "angular_velocity"),
    ({"camera_motion": {"velocity": [0, 0], "angular_velocity": [0, 0, 0]}}, "velocity"),
]  # fmt: skip

# Neither the index nor a frame may say it.
NOWHERE: Cases = [
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


def by_index(folder: Path, changes: dict[str, Any]) -> None:
    change_index(folder, **changes)


def by_section(folder: Path, changes: Any) -> None:
    change_index(folder, digs_warp=changes)


@pytest.mark.parametrize(
    ("cases", "where", "change"),
    [
        (INDEX, "", by_index),
        (SECTION, "digs_warp in transforms.json", by_section),
        (FRAME, "frame 1.*", lambda folder, changes: change_frame(folder, 1, **changes)),
        (NOWHERE, "frame 0 in transforms.json: .*", by_index),
        (NOWHERE, "frame 0 in transforms.json: .*", lambda f, changes: change_frame(f, 0, **changes)),
    ],
    ids=["index", "our section", "a frame", "rules by the index", "rules by a frame"],
)  # fmt: skip
def test_what_an_index_may_not_say_is_named(
    tmp_path: Path, cases: Cases, where: str, change: Callable[[Path, Any], None]
) -> None:
    write_capture(tmp_path, 2)
    whole = (tmp_path / "transforms.json").read_bytes()
    for changes, message in cases:
        (tmp_path / "transforms.json").write_bytes(whole)
        change(tmp_path, changes)
        with pytest.raises(CaptureError, match=where + message):
            pytest.fail(f"{changes} was read as {read_capture(tmp_path)}")


def test_another_version_or_unit_is_no_recording_of_nerfstudio_either(tmp_path: Path) -> None:
    write_capture(tmp_path, 1)
    for changes in ({"digs_warp": {"format_version": 99}}, {"depth_unit": "mm"}):
        change_index(tmp_path, **changes)
        with pytest.raises(CaptureError, match=r"99, written by a newer|depth_unit is 'mm'"):
            read_recording(tmp_path, "nerfstudio")
        change_index(tmp_path, digs_warp={})


def test_what_changes_nothing_passes(tmp_path: Path, caplog) -> None:
    write_capture(tmp_path, 2)
    assert caplog.text == ""
    zeros = dict.fromkeys(COEFFICIENTS, 0.0)
    for model in CAMERA_MODELS:
        change_index(tmp_path, camera_model=model, is_fisheye=False, applied_scale=1.0, **zeros)
        assert len(read_capture(tmp_path)) == 2
    still = {"depth_unit_scale_factor": 1.0, "applied_transform": np.eye(4)[:3].tolist()}
    change_index(tmp_path, **still, digs_warp={"pose_known": False, "weather": "rain"})
    assert len(read_capture(tmp_path)) == 2
    assert "unknown key 'pose_known' has no effect; did you mean 'poses_known'?" in caplog.text
    assert "unknown key 'weather' has no effect; expected one of format_version" in caplog.text


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


def test_pixels_of_another_size_kind_or_of_a_truncated_file_are_named(tmp_path: Path) -> None:
    frame = write_capture(tmp_path, 1).frames[0]
    for layer, load in (
        *((Layer.IMAGE, frame.load_image), (Layer.RIGHT, frame.load_right_image)),
        *((Layer.DEPTH, frame.load_depth), (Layer.DEPTH_TRUE, frame.load_depth_true)),
        (Layer.MASK, frame.load_mask),
    ):
        path, pixels = frame.path(layer), load()
        small = frame.with_layer(layer, pixels[:8])
        with pytest.raises(CaptureError, match=r"'0000'.* 12x8 pixels, expected 12x9"):
            getattr(small, load.__name__)()
        with pytest.raises(CaptureError, match=r"'0000'.* in memory, expected a file"):
            small.path(layer)
        write_image(path, pixels[:8])
        with pytest.raises(CaptureError, match=rf"{path.name}': 12x8 pixels, expected 12x9"):
            load()
        path.write_bytes(path.read_bytes()[:60])
        with pytest.raises(DigsError, match=path.name):
            load()
    write_image(frame.path(Layer.DEPTH).with_suffix(".png"), np.ones((9, 12), np.uint8))
    write_image(frame.path(Layer.MASK), np.ones((9, 12), np.uint16))
    write_image(frame.path(Layer.IMAGE), np.ones((9, 12, 1), np.uint8))
    change_frame(tmp_path, 0, depth_file_path="depth/0000.png", right_file_path=None)
    frame = read_capture(tmp_path).frames[0]
    for load, message in (
        (frame.load_depth, "8 bits per pixel, a picture of depth"),
        (frame.load_mask, "channels of uint16, expected 1 of uint8"),
        (frame.load_image, "1 channels of uint8, expected 3"),
        (frame.load_right_image, "'0000': the capture has no 'right_file_path'"),
    ):
        with pytest.raises(CaptureError, match=message):
            load()


def test_no_folder_no_index_no_json(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="gone': no such folder"):
        read_capture(tmp_path / "gone")
    with pytest.raises(CaptureError, match=r"no transforms\.json.*convert FOLDER --from"):
        read_capture(tmp_path)
    (tmp_path / "walk.mp4").write_bytes(b"film")
    with pytest.raises(CaptureError, match=r"walk\.mp4': expected a folder, found a file"):
        read_capture(tmp_path / "walk.mp4")
    for content, message in (
        (b'{"frames": [', "not valid JSON"),
        (b"[1, 2]", "expected a JSON object, found list"),
        (b"\xff\xfe\x00", "not UTF-8"),
    ):
        (tmp_path / "transforms.json").write_bytes(content)
        with pytest.raises(DigsError, match=message):
            read_capture(tmp_path)


def test_a_folder_of_results_says_what_it_is_and_where_its_capture_is(tmp_path: Path) -> None:
    capture = tmp_path / "demo" / "capture"
    write_capture(capture, 1)
    with pytest.raises(CaptureError, match=rf"results of 'digs-warp run'; .*'{capture}'"):
        read_capture(tmp_path / "demo")
    for name, message in (
        ("gaussians.npz", "holds the results of 'digs-warp reconstruct'"),
        ("run.json", "interrupted here; run it again with --resume"),
    ):
        (tmp_path / name).mkdir()
        (tmp_path / name / name).write_text("{}")
        with pytest.raises(CaptureError, match=message):
            read_capture(tmp_path / name)


def test_no_path_leaves_the_folder_and_files_are_there(tmp_path: Path) -> None:
    folder = tmp_path / "capture"
    write_capture(folder, 2)
    outside = tmp_path / "secret.png"
    write_image(outside, np.zeros((9, 12, 3), np.uint8))
    for name, target in (
        *(("link.png", outside), ("up", tmp_path), ("loop.png", folder / "loop.png")),
        ("inner.png", folder / "images/0001.png"),
    ):
        (folder / name).symlink_to(target)
    leaving = (
        "../secret.png",
        str(outside),
        "images/../../secret.png",
        "link.png",
        "up/secret.png",
    )
    for path in leaving:
        change_frame(folder, 1, file_path=path)
        with pytest.raises(CaptureError, match=r"frame 1, file_path: .*leaves the capture folder"):
            read_capture(folder)
    for path in ("a" * 5000, "a\0b", "loop.png"):  # that the system refuses
        change_frame(folder, 1, file_path=path)
        with pytest.raises(CaptureError, match="frame 1"):
            read_capture(folder)
    change_frame(folder, 1, file_path="inner.png")
    assert read_capture(folder).frames[1].load_image().shape == (9, 12, 3)
    (folder / "depth/0001.exr").unlink()
    with pytest.raises(CaptureError, match=r"frame 1, depth_file_path: 'depth/0001\.exr' does not"):
        read_capture(folder)
    # Masks, renders and cameras are found again by the name of a frame: one of two would be lost.
    change_frame(folder, 1, file_path="images/0000.png", depth_file_path=None)
    with pytest.raises(CaptureError, match="frames 0 and 1 are both named '0000'"):
        read_capture(folder)
