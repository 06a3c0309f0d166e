"""Captures as COLMAP models, nerfstudio data sets and BOP scenes, read by their own programs' rules."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from digs_warp.checks import DigsError
from digs_warp.commands.convert import export_capture_folder
from digs_warp.data.capture import Capture
from digs_warp.data.images import read_image
from digs_warp.data.layers import Layer
from digs_warp.device.libraries import import_pycolmap
from digs_warp.formats.captures.bop import depth_scale
from digs_warp.formats.captures.formats import export_capture
from digs_warp.geometry.rigid import rigid
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initialize
from digs_warp.masks.config import SegmentConfig
from digs_warp.masks.masks import segment
from digs_warp.show.report.facts import describe
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from reference.exported import (
    exported,
    points_as_integer_centered,
    true_points,
    with_last_frame,
    zoomed,
)
from reference.mesh_files import save
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


def test_bop_puts_every_pixel_and_the_object_where_they_were(
    capture: Capture, tmp_path: Path
) -> None:
    """Read as the BOP toolkit reads: millimetres, row-wise matrices, integer pixel centers."""
    scene = exported(capture, "bop", tmp_path) / "train/000000"
    cameras = json.loads((scene / "scene_camera.json").read_text())
    objects = json.loads((scene / "scene_gt.json").read_text())
    assert list(cameras) == list(objects) == ["0", "1", "2"]
    for number, frame in enumerate(capture.frames):
        entry = cameras[str(number)]
        matrix = np.reshape(entry["cam_K"], (3, 3))
        depth = read_image(scene / f"depth/{number:06d}.png")[..., 0] * entry["depth_scale"]
        w2c = rigid(np.reshape(entry["cam_R_w2c"], (3, 3)), np.array(entry["cam_t_w2c"]))
        found = points_as_integer_centered(depth, matrix, np.linalg.inv(w2c))
        # Half a step of 0.1 mm.
        np.testing.assert_allclose(found / 1000.0, true_points(capture, number), atol=7.5e-5)
        (pose,) = objects[str(number)]
        model_origin_mm = np.array(pose["cam_t_m2c"])
        np.testing.assert_allclose(model_origin_mm, 1000 * frame.camera.cam_from_world[:3, 3])
        np.testing.assert_allclose(
            np.reshape(pose["cam_R_m2c"], (3, 3)), frame.camera.cam_from_world[:3, :3]
        )
        image = read_image(scene / f"rgb/{number:06d}.png")
        np.testing.assert_array_equal(image, frame.load_image())


def test_bop_describes_the_silhouettes(capture: Capture, tmp_path: Path) -> None:
    scene = exported(capture, "bop", tmp_path) / "train/000000"
    infos = json.loads((scene / "scene_gt_info.json").read_text())
    for number, frame in enumerate(capture.frames):
        (info,) = infos[str(number)]
        mask = read_image(scene / f"mask_visib/{number:06d}_000000.png")[..., 0] == 255
        np.testing.assert_array_equal(mask, frame.load_mask() > 127)
        known = np.isfinite(frame.load_depth())
        assert info["px_count_visib"] == info["px_count_all"] == mask.sum() > 30
        assert info["px_count_valid"] == (mask & known).sum() < mask.sum()
        x, y, width, height = info["bbox_visib"]
        box = np.zeros_like(mask)
        box[y : y + height + 1, x : x + width + 1] = True
        assert not (mask & ~box).any()
        edges = (mask[y], mask[y + height], mask[:, x], mask[:, x + width])
        assert all(edge.any() for edge in edges)


def test_an_object_out_of_view_has_no_box(capture: Capture, tmp_path: Path) -> None:
    last = capture.frames[-1]
    empty = last.with_layer(Layer.MASK, np.zeros_like(last.load_mask()))
    without = with_last_frame(capture, layers=empty.layers)
    scene = exported(without, "bop", tmp_path) / "train/000000"
    (info,) = json.loads((scene / "scene_gt_info.json").read_text())["2"]
    assert info["bbox_obj"] == [-1, -1, -1, -1]
    assert (info["px_count_all"], info["visib_fract"]) == (0, 0.0)


@pytest.mark.parametrize(
    ("farthest", "scale"), [(0.5, 0.1), (6.5534, 0.1), (6.56, 0.2), (32.0, 0.5), (99.0, 1.0)]
)
def test_bop_takes_the_finest_depth_scale_that_fits(farthest: float, scale: float) -> None:
    depth = np.array([[np.nan, 0.4, farthest]])
    assert depth_scale(depth) == scale


def test_every_instance_is_exported_with_its_model(tmp_path: Path) -> None:
    box = save(tmp_path / "box.ply", trimesh.creation.box((0.2, 0.1, 0.15)))
    rod = save(tmp_path / "rod.ply", trimesh.creation.box((0.05, 0.05, 0.3)))
    config = SimulateConfig(
        profile="bare-matcher", scene=(box, rod, box), frames=2, width=96, tier="truth", unit="m"
    )
    capture = simulate(config, tmp_path / "capture")
    export_capture_folder(tmp_path / "capture", "bop", tmp_path / "bop", overwrite=False)
    scene = tmp_path / "bop/train/000000"
    poses, infos, cameras = (
        json.loads((scene / f"{name}.json").read_text())
        for name in ("scene_gt", "scene_gt_info", "scene_camera")
    )
    sizes = json.loads((tmp_path / "bop/models/models_info.json").read_text())
    assert sizes.keys() == {"1", "2"}
    hidden = 0
    assert sizes["1"]["size_x"] == pytest.approx(200, abs=1e-3)
    for number, frame in enumerate(capture.frames):
        numbers = frame.load_instances()
        assert [pose["obj_id"] for pose in poses[str(number)]] == [1, 2, 1]
        k = np.array(cameras[str(number)]["cam_K"]).reshape(3, 3)
        for i, (pose, info) in enumerate(zip(poses[str(number)], infos[str(number)], strict=True)):
            seen = read_image(scene / f"mask_visib/{number:06d}_{i:06d}.png", "mask")[..., 0] > 0
            np.testing.assert_array_equal(seen, numbers == i + 1)
            view = frame.objects[i]
            assert info["px_count_visib"] == view.pixels_visible == seen.sum()
            assert info["px_count_all"] == view.pixels
            assert info["visib_fract"] == pytest.approx(view.visible_share)
            model = trimesh.load(
                tmp_path / f"bop/models/obj_{pose['obj_id']:06d}.ply", force="mesh"
            )
            assert isinstance(model, trimesh.Trimesh)
            turn = np.array(pose["cam_R_m2c"]).reshape(3, 3)
            points = (model.vertices @ turn.T + pose["cam_t_m2c"]) @ k.T
            pixels = points[:, :2] / points[:, 2:]  # BOP: 0 in the middle of the first pixel
            x, y, width, height = info["bbox_obj"]
            np.testing.assert_allclose(pixels.min(axis=0), (x, y), atol=1.1)
            np.testing.assert_allclose(pixels.max(axis=0), (x + width, y + height), atol=1.1)
            whole = read_image(scene / f"mask/{number:06d}_{i:06d}.png", "mask")[..., 0] > 0
            assert not (seen & ~whole).any()
            # The image holds all of it: what the masks show is what BOP's toolkit would count.
            assert whole.sum() == info["px_count_all"]
            rows, columns = np.nonzero(whole)
            assert (columns.min(), rows.min()) == (x, y)
            assert (np.ptp(columns), np.ptp(rows)) == (width, height)
            hidden += int((whole & ~seen).sum())
    assert hidden > 30
    assert describe(tmp_path / "capture")["objects"].startswith("1 box (")
    with pytest.raises(DigsError, match="--instance"):  # it needs the masks of the recording
        SegmentConfig(masks="depth", instance=1)
    masks = segment(capture.frames, SegmentConfig(instance=2), tmp_path / "masks")
    for frame, path in zip(capture.frames, masks, strict=True):
        mask, inside = read_image(path, "mask")[..., 0], frame.load_instances() == 2
        np.testing.assert_array_equal(mask[inside], frame.load_mask()[inside])
        assert inside.any() and not mask[~inside].any()
