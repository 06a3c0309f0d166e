"""Every way in which a capture folder can be broken, and what the error names."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.data.capture import read_capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.record.run_log import RunLog
from reference.noise_capture import INTRINSICS, change_frame, change_index, write_capture


@pytest.mark.parametrize(
    ("key", "load", "pixels"),
    [
        (Layer.IMAGE, "load_image", np.zeros((8, 12, 3), np.uint8)),
        (Layer.RIGHT, "load_right_image", np.zeros((8, 12, 3), np.uint8)),
        (Layer.DEPTH, "load_depth", np.zeros((8, 12), np.float32)),
        (Layer.DEPTH_TRUE, "load_depth_true", np.zeros((8, 12), np.float32)),
        (Layer.MASK, "load_mask", np.zeros((8, 12), np.uint8)),
    ],
)
def test_another_size_and_a_truncated_file_are_named(
    tmp_path: Path, key: Layer, load: str, pixels: np.ndarray
) -> None:
    frame = write_capture(tmp_path, 1).frames[0]
    write_image(frame.path(key), pixels)
    with pytest.raises(CaptureError, match=r"0000\.(png|exr)': 12x8 pixels, expected 12x9"):
        getattr(frame, load)()
    path = frame.path(key)
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(DigsError, match=path.name):
        getattr(frame, load)()


def test_numbers_of_the_wrong_type_are_refused(tmp_path: Path) -> None:
    frame = write_capture(tmp_path, 1).frames[0]
    write_image(frame.path(Layer.DEPTH).with_suffix(".png"), np.ones((9, 12), np.uint8))
    write_image(frame.path(Layer.MASK), np.ones((9, 12), np.uint16))
    write_image(frame.path(Layer.IMAGE), np.ones((9, 12, 1), np.uint8))
    change_frame(tmp_path, 0, depth_file_path="depth/0000.png")
    frame = read_capture(tmp_path).frames[0]
    with pytest.raises(CaptureError, match="8 bits per pixel, a picture of depth"):
        frame.load_depth()
    with pytest.raises(CaptureError, match="expected 8 bits"):
        frame.load_mask()
    with pytest.raises(CaptureError, match="1 channels of uint8, expected 3"):
        frame.load_image()


def test_a_file_the_capture_lacks_is_named(tmp_path: Path) -> None:
    frame = write_capture(tmp_path, 1, stereo=False).frames[0]
    with pytest.raises(CaptureError, match=r"'0000': the capture has no 'right_file_path'"):
        frame.load_right_image()


def test_no_folder_no_index_no_json(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="gone': no such folder"):
        read_capture(tmp_path / "gone")
    with pytest.raises(CaptureError, match=r"no transforms\.json.*convert FOLDER --from"):
        read_capture(tmp_path)
    (tmp_path / "walk.mp4").write_bytes(b"film")
    with pytest.raises(CaptureError, match=r"walk\.mp4': expected a folder, found a file"):
        read_capture(tmp_path / "walk.mp4")
    (tmp_path / "transforms.json").write_text('{"frames": [')
    with pytest.raises(DigsError, match="not valid JSON"):
        read_capture(tmp_path)
    (tmp_path / "transforms.json").write_text("[1, 2]")
    with pytest.raises(DigsError, match="expected a JSON object, found list"):
        read_capture(tmp_path)
    (tmp_path / "transforms.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DigsError, match="not UTF-8"):
        read_capture(tmp_path)


def test_a_folder_of_results_says_what_it_is_and_where_its_capture_is(tmp_path: Path) -> None:
    capture = tmp_path / "demo" / "capture"
    write_capture(capture, 1)
    with pytest.raises(CaptureError, match=rf"results of 'digs-warp run'; .*'{capture}'"):
        read_capture(tmp_path / "demo")
    beside, elsewhere = tmp_path / "demo" / "reconstruction", tmp_path / "mine"
    RunLog("reconstruct", {}).save(beside / "run.json")
    RunLog("reconstruct", {}, results={"capture": str(capture)}).save(elsewhere / "run.json")
    for folder in (beside, elsewhere):
        with pytest.raises(CaptureError, match=f"'digs-warp reconstruct'; .*'{capture}'"):
            read_capture(folder)
    (tmp_path / "demo" / "summary.json").write_text("{}")
    (tmp_path / "many").mkdir()
    capture.rename(tmp_path / "many" / "a")
    (tmp_path / "many" / "summary.json").write_text("{}")
    with pytest.raises(CaptureError, match=r"holds 1 capture; .*many/a'"):
        read_capture(tmp_path / "many")


def test_an_interrupted_recording_says_how_to_go_on(tmp_path: Path) -> None:
    RunLog("simulate", {}).save(tmp_path / "run.json")
    with pytest.raises(CaptureError, match=r"interrupted here; .*--resume"):
        read_capture(tmp_path)


INDEX = [
    ({"frames": None}, "lists no frames"),
    ({"frames": []}, "lists no frames"),
    ({"frames": {}}, "lists no frames"),
    ({"frames": "0000"}, "lists no frames"),
    ({"frames": ["images/0000.png"]}, "frame 0"),
    ({"cx": 1e6}, "frame 0: cx is .*expected pixels from -"),
    ({"cy": -1e3}, "frame 0: cy is .*expected pixels from -"),
    *(
        ({key: None}, f"frame 0: .*has no '{key}'")
        for key in ("w", "h", "fl_x", "fl_y", "cx", "cy")
    ),
    *(
        ({"digs_warp": {"rig": rig}}, "digs_warp")
        for rig in ({}, {"baseline": "wide"}, {"baseline": -1}, None, 3)
    ),
]


@pytest.mark.parametrize(("changes", "message"), INDEX, ids=str)
def test_an_index_that_makes_no_sense_is_explained(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    write_capture(tmp_path, 1)
    change_index(tmp_path, **changes)
    with pytest.raises(CaptureError, match=message):
        read_capture(tmp_path)


@pytest.mark.parametrize(
    "changes",
    [
        {"file_path": None},
        {"transform_matrix": None},
        {"transform_matrix": [[1, 0], [0, 1]]},
        {"transform_matrix": np.diag([2.0, 2, 2, 1]).tolist()},
        {"transform_matrix": np.diag([-1.0, 1, 1, 1]).tolist()},
        {"transform_matrix": np.full((4, 4), np.nan).tolist()},
        {"transform_matrix": "identity"},
        {"time": "noon"},
        {"file_path": 7},
        {"w": "wide"},
        {"fl_x": -3.0},
    ],
    ids=str,
)
def test_a_frame_that_makes_no_sense_is_named(tmp_path: Path, changes: dict[str, Any]) -> None:
    write_capture(tmp_path, 3)
    change_frame(tmp_path, 1, **changes)
    with pytest.raises(CaptureError, match="frame 1"):
        read_capture(tmp_path)


@pytest.mark.parametrize(
    ("ours", "complaint"),
    [
        ([], "expected a JSON object"),
        ({"poses_known": "no"}, "poses_known is 'no', expected true or false"),
        ({"readout_time": -1.0}, "readout_time is -1.0, expected seconds"),
        ({"seed": 0.5}, "seed is 0.5, expected an integer"),
        ({"object_radius": True}, "object_radius is True, expected metres"),
        (
            {"world_from_mesh": [[1, 0, 0, 0]] * 4},
            "world_from_mesh is .*, expected 4 rows of 4 numbers",
        ),
        ({"objects": []}, "objects is \\[\\], expected a list of objects with name"),
        (
            {"objects": [{"name": "mug", "size": [1, 1, 1]}]},
            "objects 0: has no 'world_from_mesh'",
        ),
        ({"world_from_mesh": "unit"}, "world_from_mesh is .*, expected 4 rows of 4 numbers"),
        ({"effects": "blur"}, "effects is 'blur', expected a list of names"),
        ({"cause_labels": {"dark": "occluded"}}, "cause_labels is .*expected names by number"),
        ({"sensor": 0.12}, "sensor is 0.12, expected an object"),
    ],
    ids=str,
)
def test_facts_of_the_wrong_type_name_file_and_key(
    tmp_path: Path, ours: Any, complaint: str
) -> None:
    write_capture(tmp_path, 1)
    change_index(tmp_path, digs_warp=ours)
    with pytest.raises(
        CaptureError, match=rf"{tmp_path}', digs_warp in transforms.json[:,] {complaint}"
    ):
        read_capture(tmp_path)


def test_no_path_leaves_the_folder(tmp_path: Path) -> None:
    folder = tmp_path / "capture"
    write_capture(folder, 2)
    outside = tmp_path / "secret.png"
    write_image(outside, np.zeros((9, 12, 3), np.uint8))
    (folder / "link.png").symlink_to(outside)
    (folder / "up").symlink_to(tmp_path)
    for path in (
        "../secret.png",
        str(outside),
        "images/../../secret.png",
        "link.png",
        "up/secret.png",
    ):
        change_frame(folder, 1, file_path=path)
        with pytest.raises(CaptureError, match=r"frame 1, file_path: .*leaves the capture folder"):
            read_capture(folder)


def test_a_link_within_the_folder_is_fine(tmp_path: Path) -> None:
    write_capture(tmp_path, 1)
    (tmp_path / "link.png").symlink_to(tmp_path / "images/0000.png")
    change_frame(tmp_path, 0, file_path="link.png")
    assert read_capture(tmp_path).frames[0].load_image().shape == (9, 12, 3)


def test_a_file_that_the_index_names_but_is_not_there(tmp_path: Path) -> None:
    write_capture(tmp_path, 2)
    (tmp_path / "depth/0001.exr").unlink()
    with pytest.raises(CaptureError, match=r"frame 1, depth_file_path: 'depth/0001\.exr' does not"):
        read_capture(tmp_path)


def test_the_writer_refuses_what_the_reader_would(tmp_path: Path) -> None:
    writer = CaptureWriter(tmp_path, INTRINSICS)
    with pytest.raises(CaptureError, match=r"frame 4, file_path: shape \(5, 5, 3\)"):
        writer.write_frame(
            4,
            FrameImages(
                np.zeros((5, 5, 3), np.uint8),
                np.zeros((9, 12), np.float32),
                np.zeros((9, 12), np.uint8),
            ),
        )
    with pytest.raises(DigsError, match="frame 4: world_from_cam"):
        writer.add_pose(4, np.full((4, 4), np.nan), time=0.0)
    with pytest.raises(DigsError, match="no frame was added"):
        writer.finish()


@pytest.mark.parametrize(
    "value",
    ["1e999", "1" * 400, "1" * 5000, "[" * 100_000 + "]" * 100_000, "12.5", "NaN", '"12"', "true"],
    ids=["1e999", "400 digits", "5000 digits", "deep", "12.5", "NaN", "text", "true"],
)
def test_widths_that_no_image_has_are_refused(tmp_path: Path, value: str) -> None:
    write_capture(tmp_path, 1)
    index = tmp_path / "transforms.json"
    index.write_text(re.sub(r'"w": 12\b', f'"w": {value}', index.read_text()))
    with pytest.raises(DigsError, match=r"w is .*, expected a whole number|transforms\.json'"):
        read_capture(tmp_path)


def test_two_frames_of_one_name_are_refused(tmp_path: Path) -> None:
    """Masks, renders and cameras are found again by the name of a frame: one of the two would be lost."""
    write_capture(tmp_path, 3)
    change_frame(tmp_path, 2, file_path="images/0000.png")
    with pytest.raises(CaptureError, match="frames 0 and 2 are both named '0000'"):
        read_capture(tmp_path)


def test_file_names_that_the_system_refuses_are_named(tmp_path: Path) -> None:
    write_capture(tmp_path, 2)
    (tmp_path / "loop.png").symlink_to(tmp_path / "loop.png")
    for name in ("a" * 5000, "a\0b", "loop.png"):
        change_frame(tmp_path, 1, file_path=name)
        with pytest.raises(CaptureError, match="frame 1"):
            read_capture(tmp_path)
