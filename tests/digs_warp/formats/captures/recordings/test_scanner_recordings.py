"""Scans of phones, depth cameras and robots, written here as their programs write them."""

import json
import logging
from dataclasses import replace
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import cv2
import numpy as np
import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.images import encode_jpeg, write_image
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.formats import opened_recording, read_recording
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL, quat_xyzw_from_matrix
from digs_warp.record.files import to_json
from reference.recorded import HEIGHT, WIDTH, check_same, converted


def write_scannet(capture: Capture, folder: Path) -> None:
    """Depth of twice the size, by its own camera; the pose of the second frame is lost."""
    for part in ("color", "depth", "pose", "intrinsic"):
        (folder / part).mkdir(parents=True)
    for number, frame in enumerate(capture.frames):
        write_image(folder / f"color/{number}.png", frame.load_image())
        depth = np.nan_to_num(frame.load_depth()).repeat(2, axis=0).repeat(2, axis=1)
        write_image(folder / f"depth/{number}.png", np.round(depth * 1000).astype(np.uint16))
        pose = frame.camera.world_from_cam if number != 1 else np.full((4, 4), -np.inf)
        np.savetxt(folder / f"pose/{number}.txt", pose)
    matrix = np.eye(4)
    matrix[:2, :3] = [[19.0, 0, 9.25 - 0.5], [0, 23.0, 7.75 - 0.5]]
    np.savetxt(folder / "intrinsic/intrinsic_color.txt", matrix)
    matrix[:2, :3] = [[38.0, 0, 18.5 - 0.5], [0, 46.0, 15.5 - 0.5]]
    np.savetxt(folder / "intrinsic/intrinsic_depth.txt", matrix)


def test_scannet_depth_lands_on_the_color_pixels(capture: Capture, tmp_path: Path, caplog) -> None:
    write_scannet(capture, tmp_path / "scannet")
    with caplog.at_level(logging.WARNING):
        found = converted("scannet", tmp_path / "scannet", tmp_path / "capture")
    assert "1 of 3 frames have no pose" in caplog.text
    check_same(found, replace(capture, frames=capture.frames[::2]), 1e-3)


def write_record3d(capture: Capture, folder: Path) -> None:
    k = np.array([[19.0, 0, 9.25], [0, 23.0, 7.75], [0, 0, 1]])
    poses = []
    for number, frame in enumerate(capture.frames):
        matrix = frame.camera.world_from_cam @ OPENCV_FROM_OPENGL
        poses.append([*quat_xyzw_from_matrix(matrix[:3, :3]), *matrix[:3, 3]])
        write_image(folder / f"EXR_RGBD/rgb/{number}.png", frame.load_image())
        write_image(folder / f"EXR_RGBD/depth/{number}.exr", frame.load_depth())
    metadata = {"K": k.T.ravel(), "w": WIDTH, "h": HEIGHT, "fps": 30, "poses": np.array(poses)}
    (folder / "metadata.json").write_text(to_json(metadata))


def test_record3d_poses_have_opengl_axes(capture: Capture, tmp_path: Path) -> None:
    write_record3d(capture, tmp_path / "r3d")
    found = converted("record3d", tmp_path / "r3d", tmp_path / "capture")
    check_same(found, capture, 1e-6)
    assert found.frames[2].time == pytest.approx(2 / 30)


@pytest.mark.parametrize("kind", ["millimetres", "metres"])
def test_zed_frames_have_depth_codes_but_no_poses(
    capture: Capture, tmp_path: Path, kind: str
) -> None:
    folder = tmp_path / "zed"
    for number, frame in enumerate(capture.frames):
        write_image(folder / f"left{number:06d}.png", frame.load_image())
        write_image(folder / f"right{number:06d}.png", frame.load_image()[:, ::-1].copy())
        depth = frame.load_depth()
        if kind == "millimetres":
            write_image(
                folder / f"depth{number:06d}.png",
                np.round(np.nan_to_num(depth) * 1000).astype(np.uint16),
            )
        else:
            coded = depth.copy()
            coded[0, :3] = [np.nan, np.inf, -np.inf]
            np.save(folder / f"depth{number:06d}.npy", coded)
    calibration = {"fx": 19.0, "fy": 23.0, "cx": 9.25, "cy": 7.75, "baseline": 0.12}
    (folder / "calibration.json").write_text(json.dumps(calibration))
    found = converted("zed", folder, tmp_path / "capture")
    assert not found.knows_poses and capture.knows_poses
    assert found.rig is not None and found.rig.baseline == 0.12
    for frame, true in zip(found.frames, capture.frames, strict=True):
        expected = true.load_depth()
        if kind == "metres":
            expected[0, :3] = np.nan
        np.testing.assert_allclose(frame.load_depth(), expected, atol=6e-4)
        np.testing.assert_array_equal(frame.load_right_image(), true.load_image()[:, ::-1])
        np.testing.assert_array_equal(frame.camera.world_from_cam, np.eye(4))


def test_a_baseline_in_millimetres_is_refused(capture: Capture, tmp_path: Path) -> None:
    folder = tmp_path / "zed"
    for eye in ("left", "right"):
        write_image(folder / f"{eye}000000.png", capture.frames[0].load_image())
    calibration = {"fx": 19.0, "fy": 23.0, "cx": 9.25, "cy": 7.75, "baseline": 119.987}
    (folder / "calibration.json").write_text(json.dumps(calibration))
    with pytest.raises(
        CaptureError, match=r"baseline is 119\.987, expected metres.* write 0\.119987"
    ):
        read_recording(folder, "zed")


def millimetres(frame) -> np.ndarray:
    return np.round(np.nan_to_num(frame.load_depth()) * 1000).astype(np.uint16)


@pytest.mark.parametrize("prefix", ["", "corrected_"])
def test_polycam_has_rows_of_a_world_with_y_up(
    capture: Capture, tmp_path: Path, prefix: str
) -> None:
    folder = tmp_path / "scan/keyframes"
    for number, frame in enumerate(capture.frames):
        name = str(32283418812 + 100_000 * number)
        write_image(folder / f"{prefix}images/{name}.png", frame.load_image())
        write_image(folder / f"depth/{name}.png", millimetres(frame))
        z, x, y, last = frame.camera.world_from_cam @ OPENCV_FROM_OPENGL
        rows = np.stack([x, y, z, last])
        k = frame.camera.intrinsics
        camera = {f"t_{i}{j}": rows[i, j] for i in range(3) for j in range(4)}
        camera |= {"fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy, "width": WIDTH, "height": HEIGHT}
        path = folder / f"{prefix}cameras/{name}.json"
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(camera))
    (folder / "corrected_images").mkdir(exist_ok=True)  # may be there, and empty
    found = converted("polycam", tmp_path / "scan", tmp_path / "capture")
    check_same(found, capture, 1e-3)
    assert found.frames[2].time == pytest.approx(0.2, abs=1e-4)
    path.write_text(json.dumps(camera | {f"t_{i}{j}": 0 for i in range(3) for j in range(4)}))
    assert len(converted("polycam", tmp_path / "scan", tmp_path / "lost")) == 2
    path.write_text("{}")
    with pytest.raises(DigsError, match=f"{name}.json': has no 'width'"):
        converted("polycam", tmp_path / "scan", tmp_path / "again")


def test_stray_scanner_has_a_film_and_a_table(capture: Capture, tmp_path: Path, caplog) -> None:
    """Its film is lossy: images are compared coarsely, all else exactly."""
    folder = tmp_path / "stray"
    (folder / "depth").mkdir(parents=True)
    k = capture.frames[0].camera.intrinsics
    wide, high = 16 * WIDTH, 16 * HEIGHT
    film = cv2.VideoWriter(
        str(folder / "rgb.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 60, (wide, high)
    )
    lines = ["timestamp, frame, x, y, z, qx, qy, qz, qw"]
    for number, frame in enumerate(capture.frames):
        image = frame.load_image()[..., ::-1].repeat(16, axis=0).repeat(16, axis=1)
        film.write(np.ascontiguousarray(image))
        write_image(folder / f"depth/{number:06d}.png", millimetres(frame))
        pose = frame.camera.world_from_cam
        row = [100 + number / 60, number, *pose[:3, 3], *quat_xyzw_from_matrix(pose[:3, :3])]
        lines.append(", ".join(map(str, row)))
    film.release()
    (folder / "odometry.csv").write_text("\n".join(lines))
    matrix = np.array([[16 * k.fx, 0, 16 * k.cx - 0.5], [0, 16 * k.fy, 16 * k.cy - 0.5], [0, 0, 1]])
    np.savetxt(folder / "camera_matrix.csv", matrix, delimiter=",")
    found = converted("stray", folder, tmp_path / "capture")
    assert len(found) == len(capture) and found.knows_poses
    for here, there in zip(found.frames, capture.frames, strict=True):
        large = there.camera.resized(wide, high)
        np.testing.assert_allclose(
            here.camera.intrinsics.matrix, large.intrinsics.matrix, rtol=1e-9
        )
        np.testing.assert_allclose(
            here.camera.world_from_cam, there.camera.world_from_cam, atol=1e-9
        )
        middle = here.load_depth()[8::16, 8::16]
        np.testing.assert_allclose(middle, there.load_depth(), atol=1e-3)
        small = here.load_image()[8::16, 8::16].astype(float)
        assert np.abs(small - there.load_image()).mean() < 12
    # Without a header and the row of the second frame, with depth as arrays.
    (folder / "odometry.csv").write_text("\n".join([lines[1], *lines[3:], "", ""]))
    for number, frame in enumerate(capture.frames):
        (folder / f"depth/{number:06d}.png").unlink()
        np.save(folder / f"depth/{number:06d}.npy", millimetres(frame))
    (folder / "imu.csv").write_text("0")
    few = converted("stray", folder, tmp_path / "few")
    assert "not read: motion ('imu.csv')" in caplog.text and len(few) == 2
    for here, there in zip(few.frames, found.frames[::2], strict=True):
        pose = there.camera.world_from_cam
        np.testing.assert_array_equal(here.camera.world_from_cam, pose)
        np.testing.assert_array_equal(here.load_depth(), there.load_depth())
    for row in ("1, 2", "1, inf, 0, 0, 0, 0, 0, 0, 1"):
        (folder / "odometry.csv").write_text(f"timestamp, frame\n{row}")
        with pytest.raises(DigsError, match=r"odometry\.csv.: expected timestamp, frame, x"):
            converted("stray", folder, tmp_path / "again")


LENS = [0.01, 0.002, 0.0003, -0.0004, 0.005, 0.02, 0.003, 0.004]


def write_bag(
    capture: Capture, path: Path, kind: str, compressed: bool = False, lens: str = "plumb_bob"
) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types: dict[str, Any] = store.types
    k = capture.frames[0].camera.intrinsics
    with Writer(path, version=9, storage_plugin=StoragePlugin[kind]) as writer:
        links = {
            topic: writer.add_connection(topic, f"sensor_msgs/msg/{name}", typestore=store)
            for topic, name in {
                "/cam/color/image_raw": "CompressedImage" if compressed else "Image",
                "/cam/color/camera_info": "CameraInfo",
                "/cam/aligned_depth/image_raw": "Image",
                "/cam/aligned_depth/camera_info": "CameraInfo",
                "/other/rgb": "Image",
            }.items()
        }

        def send(topic: str, name: str, time: int, **fields: Any) -> None:
            stamp = types["builtin_interfaces/msg/Time"](sec=1, nanosec=time)
            header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="cam")
            message = types[f"sensor_msgs/msg/{name}"](header=header, **fields)
            data = store.serialize_cdr(message, f"sensor_msgs/msg/{name}")
            writer.write(links[topic], 10**9 + time, data)

        region = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        matrix = k.matrix - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
        info = {"height": HEIGHT, "width": WIDTH, "distortion_model": lens, "d": np.zeros(5)}
        info |= {"d": np.array(LENS)} if lens != "plumb_bob" else {}
        info |= {"k": matrix.ravel(), "r": np.eye(3).ravel(), "p": np.eye(3, 4).ravel()}
        info |= {"binning_x": 0, "binning_y": 0, "roi": region}
        size = {"height": HEIGHT, "width": WIDTH, "is_bigendian": 0}
        for number, frame in enumerate(capture.frames):
            time = 33_000_000 * number
            for place in ("color", "aligned_depth"):
                send(f"/cam/{place}/camera_info", "CameraInfo", time, **info)
            bgr = np.ascontiguousarray(frame.load_image()[..., ::-1])
            padded = np.pad(bgr.reshape(HEIGHT, -1), ((0, 0), (0, 6)))
            picture = {"encoding": "bgr8", "step": padded.shape[1], "data": padded.ravel(), **size}
            if compressed:
                data = cv2.imencode(".png", bgr)[1].ravel()
                send("/cam/color/image_raw", "CompressedImage", time, format="bgr8; png", data=data)
            else:
                send("/cam/color/image_raw", "Image", time, **picture)
            if number == 0:
                send("/other/rgb", "Image", time, **picture)
            if number != 1:
                depth = millimetres(frame)
                depth = np.where(depth == 0, np.uint16(65535), depth).view(np.uint8).ravel()
                fields = {"encoding": "16UC1", "step": 2 * WIDTH, "data": depth, **size}
                send("/cam/aligned_depth/image_raw", "Image", time + 5_000_000, **fields)


@pytest.mark.parametrize(
    ("kind", "compressed"), [("SQLITE3", False), ("MCAP", False), ("SQLITE3", True)]
)
def test_a_bag_gives_color_and_depth(
    capture: Capture, tmp_path: Path, kind: str, compressed: bool
) -> None:
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    write_bag(capture, tmp_path / "bag", kind, compressed)
    source = tmp_path / "bag"
    if kind == "MCAP":
        (source,) = source.glob("*.mcap")
    found = converted("ros", source, tmp_path / "capture")
    assert not found.knows_poses and len(found) == 3
    assert [frame.has(Layer.DEPTH) for frame in found.frames] == [True, False, True]
    for number, (here, there) in enumerate(zip(found.frames, capture.frames, strict=True)):
        np.testing.assert_array_equal(here.load_image(), there.load_image())
        assert here.camera.intrinsics == there.camera.intrinsics
        assert here.time == pytest.approx(0.033 * number)
        if number != 1:
            np.testing.assert_allclose(here.load_depth(), there.load_depth(), atol=1e-3)


def test_a_lens_of_eight_coefficients_is_opencvs(capture: Capture, tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    write_bag(capture, tmp_path / "bag", "SQLITE3", lens="rational_polynomial")
    with opened_recording(tmp_path / "bag", "ros") as recording:
        view = recording.frames[0].view
    assert view is not None and view.lens.coefficients == tuple(LENS)


def test_what_is_no_bag_is_named(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    (tmp_path / "a.bag").write_bytes(b"no bag")
    with pytest.raises(DigsError, match=r"a\.bag'.*expected a \.bag, \.mcap, \.db3 or the"):
        converted("ros", tmp_path / "a.bag", tmp_path / "capture")


def test_record3d_shares_one_file(capture: Capture, tmp_path: Path) -> None:
    liblzfse = pytest.importorskip("liblzfse", reason="pyliblzfse is not installed")
    k = capture.frames[0].camera.intrinsics
    matrix = np.array([[k.fx, 0, k.cx], [0, k.fy, k.cy], [0, 0, 1]])
    metadata = {"K": matrix.T.ravel().tolist(), "w": WIDTH, "h": HEIGHT, "dw": WIDTH, "dh": HEIGHT}
    metadata |= {"fps": 60, "poses": []}
    with ZipFile(tmp_path / "walk.r3d", "w") as archive:
        for number, frame in enumerate(capture.frames):
            pose = frame.camera.world_from_cam @ OPENCV_FROM_OPENGL
            turn = quat_xyzw_from_matrix(pose[:3, :3]).tolist()
            metadata["poses"].append([*turn, *pose[:3, 3].tolist()])
            archive.writestr(f"rgbd/{number}.jpg", encode_jpeg(frame.load_image(), 100))
            depth = frame.load_depth().astype("<f4").tobytes()
            archive.writestr(f"rgbd/{number}.depth", liblzfse.compress(depth))
        archive.writestr("metadata", json.dumps(metadata))
    found = converted("record3d", tmp_path / "walk.r3d", tmp_path / "capture")
    assert len(found) == 3 and found.knows_poses
    assert found.frames[2].time == pytest.approx(2 / 60)
    for here, there in zip(found.frames, capture.frames, strict=True):
        np.testing.assert_array_equal(here.load_depth(), there.load_depth())
        pose = there.camera.world_from_cam
        np.testing.assert_allclose(here.camera.world_from_cam, pose, atol=1e-6)
    (tmp_path / "broken.r3d").write_bytes((tmp_path / "walk.r3d").read_bytes()[:200])
    with pytest.raises(DigsError, match=r"broken\.r3d'.*expected a \.r3d file"):
        converted("record3d", tmp_path / "broken.r3d", tmp_path / "again")
