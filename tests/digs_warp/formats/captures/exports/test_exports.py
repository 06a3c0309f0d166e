"""What all exports have in common, and sets for training and Open3D, read back by their own libraries."""

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.commands.convert import Convert
from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.images import encode_jpeg, read_image
from digs_warp.data.layers import Layer
from digs_warp.formats.captures import training_sets
from digs_warp.formats.captures.formats import EXPORTERS, export_capture
from digs_warp.formats.captures.frames import encode_depth
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL, matrix_from_quat_xyzw, rigid
from digs_warp.record.files import read_json
from reference.exported import (
    assert_exported_alike_twice,
    exported,
    true_points,
    with_last_frame,
    zoomed,
)
from reference.optional import open3d_or_skip
from reference.recorded import CAMERA, HEIGHT, WIDTH

# The others need stereo pairs (test_export_stereo.py), or are read below.
OF_ONE_EYE = ["colmap", "colmap-text", "nerfstudio", "tum", "bop", "redwood"]


def test_captures_that_a_format_cannot_hold_are_refused(capture: Capture, tmp_path: Path) -> None:
    last = capture.frames[-1]
    lost = replace(capture, about=replace(capture.about, poses_known=False))
    bare = with_last_frame(capture, layers=last.without_layer(Layer.DEPTH).layers)
    for wrong, forms, message in (
        (lost, EXPORTERS, "no camera poses"),
        (zoomed(capture), ("tum", "redwood"), "2 different cameras"),
        (bare, ("tum", "redwood", "bop"), "'0002': the capture has no 'depth_file_path'"),
        (with_last_frame(capture, time=0.25), ("tum",), "several frames share a time"),
    ):
        for form in forms:
            with pytest.raises(CaptureError, match=message):
                export_capture(wrong, form, tmp_path / "out")


def test_depth_that_16_bits_cannot_hold_becomes_unknown() -> None:
    depth = np.array([[np.nan, 0.0001, 1.0, 13.1068, 13.107]], dtype=np.float32)
    units, lost = encode_depth(depth, 5000.0)
    assert units.dtype == np.uint16
    np.testing.assert_array_equal(units, [[0, 0, 5000, 65534, 0]])
    assert lost == 1


def test_lost_depth_is_told(tmp_path: Path, caplog) -> None:
    writer = CaptureWriter(tmp_path / "capture", CAMERA)
    depth = np.full((HEIGHT, WIDTH), 14.0, np.float32)
    depth[0] = 2.0
    image, mask = np.zeros((HEIGHT, WIDTH, 3), np.uint8), np.zeros((HEIGHT, WIDTH), np.uint8)
    writer.write_frame(0, FrameImages(image=image, depth=depth, mask=mask))
    writer.add_pose(0, np.eye(4), 0.0)
    export_capture(writer.finish(), "tum", tmp_path / "out")
    assert f"up to 13.11 m: {WIDTH * (HEIGHT - 1)} pixels" in caplog.text


def test_the_command_leaves_a_complete_folder_or_none(capture: Capture, tmp_path: Path) -> None:
    out = tmp_path / "out"
    message = Convert(source=capture.folder, to="tum", out=out).execute()
    assert "3 frames as tum" in message
    assert read_json(out / "run.json", "record")["settings"]["to"] == "tum"
    with pytest.raises(DigsError, match="not empty"):
        Convert(source=capture.folder, to="bop", out=out).execute()
    Convert(source=capture.folder, to="bop", out=out, overwrite=True).execute()
    assert not (out / "rgb.txt").exists() and (out / "camera.json").exists()
    bare = shutil.copytree(capture.folder, tmp_path / "bare")
    (bare / "masks/0000.png").write_bytes(b"no image")
    with pytest.raises(DigsError, match=r"masks/0000\.png"):
        Convert(source=bare, to="bop", out=tmp_path / "broken").execute()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bare", "out"]


def test_exports_do_not_depend_on_their_threads(capture: Capture, tmp_path: Path) -> None:
    for form in (*OF_ONE_EYE, "webdataset"):
        assert_exported_alike_twice(capture, form, tmp_path / form)


def test_images_of_other_types_become_png(capture: Capture, tmp_path: Path) -> None:
    frame = capture.frames[-1]
    (tmp_path / "photo.jpg").write_bytes(encode_jpeg(frame.load_image(), quality=100))
    photo = with_last_frame(capture, layers={**frame.layers, Layer.IMAGE: tmp_path / "photo.jpg"})
    folder = exported(photo, "redwood", tmp_path / "out")
    found = read_image(folder / "color/00002.png")
    np.testing.assert_array_equal(found, photo.frames[-1].load_image())


def rows(path: Path) -> list[list[str]]:
    """The words of each line that is no comment."""
    return [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]


def of_redwood(o3d: Any, folder: Path) -> Iterator[tuple[Any, np.ndarray, Path, Path]]:
    intrinsic = o3d.io.read_pinhole_camera_intrinsic(str(folder / "camera_intrinsic.json"))
    assert (intrinsic.width, intrinsic.height) == (WIDTH, HEIGHT)
    poses = o3d.io.read_pinhole_camera_trajectory(str(folder / "trajectory.log")).parameters
    for number, pose in enumerate(poses):
        name = f"{number:05d}.png"
        yield intrinsic, pose.extrinsic, folder / "color" / name, folder / "depth" / name


def of_tum(o3d: Any, folder: Path) -> Iterator[tuple[Any, np.ndarray, Path, Path]]:
    fx, fy, cx, cy = map(float, rows(folder / "calibration.txt")[0])
    intrinsic = o3d.camera.PinholeCameraIntrinsic(WIDTH, HEIGHT, fx, fy, cx, cy)
    lists = (rows(folder / f"{name}.txt") for name in ("groundtruth", "rgb", "depth"))
    for truth, color, depth in zip(*lists, strict=True):
        assert truth[0] == color[0] == depth[0]
        t = np.array(truth[1:], dtype=float)
        extrinsic = np.linalg.inv(rigid(matrix_from_quat_xyzw(t[3:]), t[:3]))
        yield intrinsic, extrinsic, folder / color[1], folder / depth[1]


@pytest.mark.parametrize(
    ("form", "read", "scale", "tolerance"),
    [("redwood", of_redwood, 1000.0, 7e-4), ("tum", of_tum, 5000.0, 1.5e-4)],
)
def test_open3d_gets_the_points_back(
    capture: Capture, tmp_path: Path, form: str, read: Any, scale: float, tolerance: float
) -> None:
    o3d = open3d_or_skip()
    found = list(read(o3d, exported(capture, form, tmp_path)))
    assert len(found) == len(capture)
    for number, (intrinsic, extrinsic, color, depth) in enumerate(found):
        cloud = o3d.geometry.PointCloud.create_from_depth_image(
            o3d.io.read_image(str(depth)),
            *(intrinsic, extrinsic),
            depth_scale=scale,
            depth_trunc=100.0,
        )
        expected = true_points(capture, number)
        np.testing.assert_allclose(np.asarray(cloud.points), expected, atol=tolerance)
        image = np.asarray(o3d.io.read_image(str(color)))
        np.testing.assert_array_equal(image, capture.frames[number].load_image())


def test_h5py_reads_what_blenderproc_would_write(
    capture: Capture, pairs: Capture, tmp_path: Path
) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: extra hdf5")
    folder = exported(capture, "hdf5", tmp_path / "one")
    for number, frame in enumerate(capture.frames):
        with h5py.File(folder / f"{number}.hdf5") as file:
            np.testing.assert_array_equal(file["colors"], frame.load_image())
            np.testing.assert_array_equal(file["depth"], np.nan_to_num(frame.load_depth()))
            inside = frame.load_mask() > 127
            np.testing.assert_array_equal(file["instance_segmaps"], inside)
            (camera,) = json.loads(file["campose"][()])
        pose = np.array(camera["cam2world_matrix"]) @ OPENCV_FROM_OPENGL
        np.testing.assert_allclose(pose, frame.camera.world_from_cam, atol=1e-12)
        np.testing.assert_array_equal(camera["cam_K"], frame.camera.intrinsics.matrix)
    with h5py.File(exported(pairs, "hdf5", tmp_path / "two") / "1.hdf5") as file:
        left, right = np.array(file["colors"])
    np.testing.assert_array_equal(left, pairs.frames[1].load_image())
    np.testing.assert_array_equal(right, pairs.frames[1].load_right_image())


def test_webdataset_reads_the_shards(pairs: Capture, tmp_path: Path, monkeypatch) -> None:
    wds = pytest.importorskip("webdataset", reason="webdataset is not installed")
    monkeypatch.setattr(training_sets, "FRAMES_PER_SHARD", 2)
    folder = exported(pairs, "webdataset", tmp_path)
    shards = [str(path) for path in sorted(folder.glob("*.tar"))]
    assert len(shards) == 2
    samples = list(wds.WebDataset(shards, shardshuffle=False).decode("rgb8"))
    assert [sample["__key__"] for sample in samples] == ["0000", "0001", "0002"]
    for sample, frame in zip(samples, pairs.frames, strict=True):
        np.testing.assert_array_equal(sample["image.png"], frame.load_image())
        np.testing.assert_array_equal(sample["right.png"], frame.load_right_image())
        np.testing.assert_array_equal(sample["depth.npy"], np.nan_to_num(frame.load_depth()))
        np.testing.assert_array_equal(sample["mask.png"][..., 0], frame.load_mask())
        facts = sample["json"]
        np.testing.assert_allclose(facts["cam2world_matrix"], frame.camera.world_from_cam)
        assert facts["time"] == frame.time
