"""The capture folder: round trips, folders made by others, and every way in which one can be broken."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.camera import Intrinsics
from digs_warp.capture import Capture, Rig, read_capture
from digs_warp.capture_writer import BASIC_LAYERS, CaptureWriter, FrameImages, file_hashes
from digs_warp.checks import CaptureError, DigsError
from digs_warp.geometry import look_at
from digs_warp.images import read_image, write_image

INTRINSICS = Intrinsics(12, 9, 15.0, 16.0, 6.5, 4.25)
UP = np.array([0.0, 0.0, 1.0])


def frame_images(seed: int, stereo: bool = True) -> FrameImages:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.5, 2.0, (9, 12)).astype(np.float32)
    depth[rng.random((9, 12)) < 0.2] = np.nan
    return FrameImages(
        image=rng.integers(0, 256, (9, 12, 3), dtype=np.uint8),
        depth=depth,
        mask=rng.integers(0, 256, (9, 12), dtype=np.uint8),
        right=rng.integers(0, 256, (9, 12, 3), dtype=np.uint8) if stereo else None,
        depth_true=depth + np.float32(0.25) if stereo else None,
    )


def view(number: int) -> np.ndarray:
    return look_at(np.array([np.cos(number), np.sin(number), 0.3]), np.zeros(3), UP)


def write_capture(folder: Path, count: int = 3, stereo: bool = True) -> Capture:
    writer = CaptureWriter(folder, INTRINSICS, Rig(0.12) if stereo else None)
    for number in range(count):
        writer.write_frame(number, frame_images(number, stereo))
        writer.add_pose(number, view(number), time=0.5 * number)
    return writer.finish({"note": "a test"})


def change_index(folder: Path, **changes: Any) -> None:
    """Set keys of transforms.json; a value of None removes the key."""
    path = folder / "transforms.json"
    index = {**json.loads(path.read_text()), **changes}
    path.write_text(json.dumps({key: value for key, value in index.items() if value is not None}))


def change_frame(folder: Path, number: int, **changes: Any) -> None:
    frames = json.loads((folder / "transforms.json").read_text())["frames"]
    changed = {**frames[number], **changes}
    frames[number] = {key: value for key, value in changed.items() if value is not None}
    change_index(folder, frames=frames)


@pytest.mark.parametrize("stereo", [True, False])
def test_what_is_written_is_read(tmp_path: Path, stereo: bool) -> None:
    write_capture(tmp_path, 3, stereo)
    capture = read_capture(tmp_path)
    assert len(capture) == 3
    assert capture.rig == (Rig(0.12) if stereo else None)
    assert capture.metadata["note"] == "a test"
    for number, frame in enumerate(capture.frames):
        images = frame_images(number, stereo)
        assert frame.name == f"{number:04d}"
        assert frame.time == 0.5 * number
        assert frame.camera.intrinsics == INTRINSICS
        np.testing.assert_allclose(frame.camera.world_from_cam, view(number), atol=1e-15)
        np.testing.assert_array_equal(frame.load_image(), images.image)
        np.testing.assert_array_equal(frame.load_depth(), images.depth)
        np.testing.assert_array_equal(frame.load_mask(), images.mask)
        if stereo:
            assert images.right is not None
            assert images.depth_true is not None
            np.testing.assert_array_equal(frame.load_right_image(), images.right)
            np.testing.assert_array_equal(frame.load_depth_true(), images.depth_true)


def test_writing_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    write_capture(tmp_path / "a")
    write_capture(tmp_path / "b")
    hashes = file_hashes(tmp_path / "a")
    assert hashes == file_hashes(tmp_path / "b")
    assert set(hashes) == {"transforms.json"} | {
        f"{folder}/{number:04d}.{suffix}"
        for number in range(3)
        for folder, suffix in [
            ("images", "png"),
            ("right", "png"),
            ("depth", "exr"),
            ("depth_true", "exr"),
            ("masks", "png"),
        ]
    }


def test_frames_may_be_written_in_any_order_and_resumed(tmp_path: Path) -> None:
    writer = CaptureWriter(tmp_path, INTRINSICS)
    writer.write_frame(2, frame_images(2))
    writer.write_frame(0, frame_images(0))
    assert [writer.has_frame(number) for number in range(3)] == [True, False, True]
    (tmp_path / "masks/0002.png").unlink()
    assert not writer.has_frame(2)

    again = CaptureWriter(tmp_path, INTRINSICS)
    for number in (2, 1, 0):
        if not again.has_frame(number):
            again.write_frame(number, frame_images(number))
        again.add_pose(number, view(number), time=float(number))
    assert [frame.name for frame in again.finish().frames] == ["0000", "0001", "0002"]


def test_the_layers_of_a_sensor_come_back_and_are_optional(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    cause = rng.integers(0, 17, (9, 12), dtype=np.uint8)
    confidence = rng.integers(0, 256, (9, 12), dtype=np.uint8)
    normals = rng.normal(size=(9, 12, 3)).astype(np.float32)
    layers = replace(frame_images(0), cause=cause, confidence=confidence, normals=normals)
    writer = CaptureWriter(tmp_path, INTRINSICS)
    writer.write_frame(0, layers)
    writer.write_frame(1, frame_images(1))
    wanted = (*BASIC_LAYERS, "cause_file_path")
    assert [writer.has_frame(number, wanted) for number in (0, 1)] == [True, False]
    for number in (0, 1):
        writer.add_pose(number, view(number), time=float(number))
    with_layers, without = writer.finish().frames
    np.testing.assert_array_equal(with_layers.load_cause(), cause)
    np.testing.assert_array_equal(np.round(255 * with_layers.load_confidence()), confidence)
    np.testing.assert_array_equal(with_layers.load_normals(), normals)
    assert not without.has("cause_file_path")
    with pytest.raises(CaptureError, match="the capture has no 'confidence_file_path'"):
        without.load_confidence()


def test_sensor_codes_survive_in_the_file_and_read_as_unknown(tmp_path: Path) -> None:
    images = frame_images(0)
    assert images.depth is not None
    images.depth[0, :3] = [np.nan, -np.inf, np.inf]
    writer = CaptureWriter(tmp_path, INTRINSICS)
    writer.write_frame(0, images)
    writer.add_pose(0, view(0), time=0.0)
    (frame,) = writer.finish().frames
    np.testing.assert_array_equal(read_image(frame.files["depth_file_path"])[..., 0], images.depth)
    assert np.isnan(frame.load_depth()[0, :3]).all()


def test_every_eighth_frame_is_held_out(tmp_path: Path) -> None:
    capture = write_capture(tmp_path, 10, stereo=False)
    train, test = capture.split(test_every=8)
    assert [frame.name for frame in test] == ["0000", "0008"]
    assert sorted(f.name for f in [*train, *test]) == [f.name for f in capture.frames]


def nerfstudio_folder(folder: Path) -> None:
    """A folder as an RGB-D phone app exports it for nerfstudio, written by hand."""
    rng = np.random.default_rng(0)
    write_image(folder / "rgb/a.png", rng.integers(0, 256, (9, 12, 4), dtype=np.uint8))
    depth_mm = np.full((9, 12), 1500, dtype=np.uint16)
    depth_mm[0, :4] = 0
    write_image(folder / "depth/a.png", depth_mm)
    index = {
        "w": 12,
        "h": 9,
        "fl_x": 1.0,
        "fl_y": 1.0,
        "cx": 6.5,
        "cy": 4.25,
        "frames": [
            {
                "file_path": "rgb/a.png",
                "depth_file_path": "depth/a.png",
                # OpenGL: the camera looks along its own -z, here from (0, 0, 3) straight down on the origin.
                "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]],
                "fl_x": 15.0,  # a frame's own value wins
                "fl_y": 16.0,
            }
        ],
    }
    (folder / "transforms.json").write_text(json.dumps(index))


def test_a_folder_of_another_tool_is_read(tmp_path: Path) -> None:
    nerfstudio_folder(tmp_path)
    capture = read_capture(tmp_path)
    (frame,) = capture.frames
    assert capture.rig is None
    assert frame.time == 0.0
    assert not frame.has("mask_path")
    assert frame.camera.intrinsics == INTRINSICS
    # In OpenCV axes it looks along +z of the camera: the origin appears at the principal point.
    px, depth = frame.camera.project(np.array([[0.0, 0, 0], [0, 0.3, 0]]))
    np.testing.assert_allclose(px, [[6.5, 4.25], [6.5, 4.25 - 16 * 0.1]])
    np.testing.assert_allclose(depth, 3.0)
    assert frame.load_image().shape == (9, 12, 3)
    depth = frame.load_depth()
    assert depth.dtype == np.float32
    assert np.isnan(depth[0, :4]).all()
    assert np.count_nonzero(depth == np.float32(1.5)) == 9 * 12 - 4


def test_every_mark_for_missing_depth_becomes_nan(tmp_path: Path) -> None:
    capture = write_capture(tmp_path, 1)
    depth = np.ones((9, 12), dtype=np.float32)
    depth[0, :5] = [np.nan, np.inf, -np.inf, 0.0, -1.0]
    write_image(capture.frames[0].files["depth_file_path"], depth)
    found = capture.frames[0].load_depth()
    assert np.isnan(found[0, :5]).all()
    assert (found.ravel()[5:] == 1.0).all()


@pytest.mark.parametrize(
    ("key", "load", "pixels"),
    [
        ("file_path", "load_image", np.zeros((8, 12, 3), np.uint8)),
        ("right_file_path", "load_right_image", np.zeros((8, 12, 3), np.uint8)),
        ("depth_file_path", "load_depth", np.zeros((8, 12), np.float32)),
        ("depth_true_file_path", "load_depth_true", np.zeros((8, 12), np.float32)),
        ("mask_path", "load_mask", np.zeros((8, 12), np.uint8)),
    ],
)
def test_another_size_names_file_found_and_expected(
    tmp_path: Path, key: str, load: str, pixels: np.ndarray
) -> None:
    frame = write_capture(tmp_path, 1).frames[0]
    write_image(frame.files[key], pixels)
    with pytest.raises(CaptureError, match=r"0000\.(png|exr)': 12x8 pixels, expected 12x9"):
        getattr(frame, load)()


@pytest.mark.parametrize("key", ["file_path", "depth_file_path", "mask_path"])
def test_a_truncated_file_is_named_when_loaded(tmp_path: Path, key: str) -> None:
    frame = write_capture(tmp_path, 1).frames[0]
    path = frame.files[key]
    path.write_bytes(path.read_bytes()[:60])
    load = {"file_path": "load_image", "depth_file_path": "load_depth", "mask_path": "load_mask"}
    with pytest.raises(DigsError, match=path.name):
        getattr(frame, load[key])()


def test_numbers_of_the_wrong_type_are_refused(tmp_path: Path) -> None:
    files = write_capture(tmp_path, 1).frames[0].files
    write_image(files["depth_file_path"].with_suffix(".png"), np.ones((9, 12), np.uint8))
    write_image(files["mask_path"], np.ones((9, 12), np.uint16))
    write_image(files["file_path"], np.ones((9, 12, 1), np.uint8))
    change_frame(tmp_path, 0, depth_file_path="depth/0000.png")
    frame = read_capture(tmp_path).frames[0]
    with pytest.raises(CaptureError, match="uint8, expected a float EXR in metres"):
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
    with pytest.raises(CaptureError, match=r"no transforms\.json.*interrupted"):
        read_capture(tmp_path)
    (tmp_path / "transforms.json").write_text('{"frames": [')
    with pytest.raises(DigsError, match="not valid JSON"):
        read_capture(tmp_path)
    (tmp_path / "transforms.json").write_text("[1, 2]")
    with pytest.raises(DigsError, match="expected a JSON object, found list"):
        read_capture(tmp_path)
    (tmp_path / "transforms.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DigsError, match="not valid JSON"):
        read_capture(tmp_path)


@pytest.mark.parametrize("frames", [None, [], {}, "0000"])
def test_an_index_without_frames_raises(tmp_path: Path, frames: Any) -> None:
    write_capture(tmp_path, 1)
    change_index(tmp_path, frames=frames)
    with pytest.raises(CaptureError, match="lists no frames"):
        read_capture(tmp_path)


@pytest.mark.parametrize("key", ["w", "h", "fl_x", "fl_y", "cx", "cy"])
def test_missing_intrinsics_are_named(tmp_path: Path, key: str) -> None:
    write_capture(tmp_path, 1)
    change_index(tmp_path, **{key: None})
    with pytest.raises(CaptureError, match=f"frame 0: .*has no '{key}'"):
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


def test_a_frame_that_is_no_object_is_named(tmp_path: Path) -> None:
    write_capture(tmp_path, 1)
    change_index(tmp_path, frames=["images/0000.png"])
    with pytest.raises(CaptureError, match="frame 0"):
        read_capture(tmp_path)


@pytest.mark.parametrize(
    "ours",
    [
        {"rig": {}},
        {"rig": {"baseline": "wide"}},
        {"rig": {"baseline": -1}},
        {"rig": None},
        {"rig": 3},
    ],
)
def test_a_broken_rig_raises(tmp_path: Path, ours: Any) -> None:
    write_capture(tmp_path, 1)
    change_index(tmp_path, digs_warp=ours)
    with pytest.raises(CaptureError, match="digs_warp"):
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
