"""Captures as nerfstudio data sets: points, cameras and split as its data parser and OpenSplat read them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initialize
from reference.exported import exported, with_last_frame, zoomed
from reference.optional import open3d_or_skip
from reference.tiny_capture import write_tiny_capture


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_tiny_capture(tmp_path_factory.mktemp("ball") / "capture", frames=10)


def index_of(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "transforms.json").read_text())


def test_nerfstudio_starts_from_our_points(ball: Capture, tmp_path: Path) -> None:
    """Its data parser reads the file with Open3D, and moves the points like the poses."""
    folder = exported(ball, "nerfstudio", tmp_path)
    index = index_of(folder)
    assert "applied_transform" not in index and "applied_scale" not in index
    cloud = open3d_or_skip().io.read_point_cloud(str(folder / index["ply_file_path"]))
    expected = initialize(ball.split()[0], InitConfig()).points
    np.testing.assert_array_equal(np.asarray(cloud.points), expected.points_world)
    np.testing.assert_allclose(np.asarray(cloud.colors), expected.colors, atol=0.5001 / 255)


def test_opensplat_starts_from_our_points(ball: Capture, tmp_path: Path) -> None:
    """It wants these lines in this order, and takes the rest of the file as rows of 15 bytes."""
    folder = exported(ball, "nerfstudio", tmp_path)
    header, _, body = (folder / "sparse_pc.ply").read_bytes().partition(b"end_header\n")
    lines = header.decode().splitlines()
    count = len(initialize(ball.split()[0], InitConfig()).points)
    assert lines[:3] == ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    assert [line.split()[1:] for line in lines[3:]] == [
        *(["float", axis] for axis in "xyz"),
        *(["uchar", color] for color in ("red", "green", "blue")),
    ]
    assert len(body) == 15 * count
    for frame in index_of(folder)["frames"]:
        assert (folder / frame["file_path"]).is_file()


def test_nerfstudio_holds_out_the_frames_that_we_do(ball: Capture, tmp_path: Path) -> None:
    index = index_of(exported(ball, "nerfstudio", tmp_path))
    training, held_out = ([f"images/{frame.name}.png" for frame in part] for part in ball.split())
    assert index["train_filenames"] == training
    assert index["val_filenames"] == index["test_filenames"] == held_out


def test_cameras_that_differ_are_given_per_frame_only(capture: Capture, tmp_path: Path) -> None:
    """nerfstudio takes a shared key for all frames, whatever a frame says."""
    index = index_of(exported(zoomed(capture), "nerfstudio", tmp_path))
    assert not {"w", "h", "fl_x", "fl_y", "cx", "cy"} & index.keys()
    assert [frame["fl_x"] for frame in index["frames"]] == [19.0, 19.0, 30.0]


def test_a_layer_is_in_all_frames_or_in_none(capture: Capture, tmp_path: Path) -> None:
    last = capture.frames[-1].layers
    bare = with_last_frame(capture, layers={k: v for k, v in last.items() if k.name == "IMAGE"})
    for frame in index_of(exported(bare, "nerfstudio", tmp_path))["frames"]:
        assert frame.keys().isdisjoint({"mask_path", "depth_file_path"})
