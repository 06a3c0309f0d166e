"""Captures as COLMAP models and nerfstudio data sets, read by pycolmap, Open3D and the rules of OpenSplat."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.images import read_image
from digs_warp.data.layers import Layer
from digs_warp.device.libraries import import_pycolmap
from digs_warp.formats.captures.formats import export_capture
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initialize
from reference.exported import exported, with_last_frame, zoomed
from reference.optional import open3d_or_skip
from reference.tiny_capture import RADIUS


@pytest.mark.parametrize("form", ["colmap", "colmap-text"])
def test_the_points_are_those_that_our_own_start_takes(
    tiny_capture: Capture, form: str, tmp_path: Path
) -> None:
    """Of the object, of the training frames, one per voxel."""
    model = import_pycolmap().Reconstruction(exported(tiny_capture, form, tmp_path) / "sparse/0")
    expected = initialize(tiny_capture.split()[0], InitConfig()).points
    found = [model.points3D[key] for key in sorted(model.points3D)]
    np.testing.assert_allclose([p.xyz for p in found], expected.points_world, atol=1e-7)
    np.testing.assert_allclose([p.color for p in found], 255 * expected.colors, atol=0.5001)
    radii = np.linalg.norm([p.xyz for p in found], axis=1)
    assert len(found) > 1000 and abs(radii - RADIUS).max() < 0.01


@pytest.mark.parametrize("has_points", [False, True])
def test_a_capture_without_depth_keeps_its_points(
    tiny_capture: Capture, tmp_path: Path, has_points: bool
) -> None:
    flat = replace(
        tiny_capture,
        frames=tuple(
            replace(frame, layers={Layer.IMAGE: frame.layers[Layer.IMAGE]})
            for frame in tiny_capture.frames
        ),
    )
    points = initialize(tiny_capture.split()[0], InitConfig()).points
    flat = replace(flat, points=points if has_points else None)
    model = import_pycolmap().Reconstruction(exported(flat, "colmap", tmp_path / "a") / "sparse/0")
    count = len(points) if has_points else 0
    assert (model.num_points3D(), model.num_reg_images()) == (count, len(flat))
    assert (exported(flat, "nerfstudio", tmp_path / "b") / "sparse_pc.ply").is_file() == has_points


def test_masks_without_the_object_are_a_warning(
    tiny_capture: Capture, tmp_path: Path, caplog
) -> None:
    empty = np.zeros_like(tiny_capture.frames[0].load_mask())
    frames = tuple(frame.with_layer(Layer.MASK, empty) for frame in tiny_capture.frames)
    export_capture(replace(tiny_capture, frames=frames), "colmap", tmp_path)
    assert "exported without points to start from: initialization: no points in 14" in caplog.text


def test_colmap_keeps_a_camera_per_frame(capture: Capture, tmp_path: Path) -> None:
    folder = exported(zoomed(capture), "colmap", tmp_path)
    model = import_pycolmap().Reconstruction(folder / "sparse/0")
    focal = [model.images[i].camera.params[0] for i in (1, 2, 3)]
    assert focal == [19.0, 19.0, 30.0]


def test_colmap_masks_stand_beside_their_images(capture: Capture, tmp_path: Path) -> None:
    folder = exported(capture, "colmap", tmp_path)
    for frame in capture.frames:
        mask = read_image(folder / f"masks/{frame.name}.png.png")[..., 0]
        np.testing.assert_array_equal(mask == 255, frame.load_mask() > 127)
        assert set(np.unique(mask)) == {0, 255}


def index_of(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "transforms.json").read_text())


def test_nerfstudio_starts_from_our_points(tiny_capture: Capture, tmp_path: Path) -> None:
    """Its data parser reads the file with Open3D, and moves the points like the poses."""
    folder = exported(tiny_capture, "nerfstudio", tmp_path)
    index = index_of(folder)
    assert "applied_transform" not in index and "applied_scale" not in index
    cloud = open3d_or_skip().io.read_point_cloud(str(folder / index["ply_file_path"]))
    expected = initialize(tiny_capture.split()[0], InitConfig()).points
    np.testing.assert_array_equal(np.asarray(cloud.points), expected.points_world)
    np.testing.assert_allclose(np.asarray(cloud.colors), expected.colors, atol=0.5001 / 255)


def test_opensplat_starts_from_our_points(tiny_capture: Capture, tmp_path: Path) -> None:
    """It wants these lines in this order, and takes the rest of the file as rows of 15 bytes."""
    folder = exported(tiny_capture, "nerfstudio", tmp_path)
    header, _, body = (folder / "sparse_pc.ply").read_bytes().partition(b"end_header\n")
    lines = header.decode().splitlines()
    count = len(initialize(tiny_capture.split()[0], InitConfig()).points)
    assert lines[:3] == ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    assert [line.split()[1:] for line in lines[3:]] == [
        *(["float", axis] for axis in "xyz"),
        *(["uchar", color] for color in ("red", "green", "blue")),
    ]
    assert len(body) == 15 * count
    for frame in index_of(folder)["frames"]:
        assert (folder / frame["file_path"]).is_file()


def test_nerfstudio_holds_out_the_frames_that_we_do(tiny_capture: Capture, tmp_path: Path) -> None:
    index = index_of(exported(tiny_capture, "nerfstudio", tmp_path))
    training, held_out = (
        [f"images/{frame.name}.png" for frame in part] for part in tiny_capture.split()
    )
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
