"""Recordings in other programs' folders: every pixel ends as the same point; broken folders are named."""

import json
import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.camera import Camera, Intrinsics, pixel_centers
from digs_warp.capture import Capture, CaptureWriter, FrameImages, read_capture
from digs_warp.checks import CaptureError, DigsError
from digs_warp.cli import main
from digs_warp.geometry import OPENCV_FROM_OPENGL, look_at, quat_xyzw_from_matrix
from digs_warp.images import encode_jpeg, read_image, write_image
from digs_warp.interchange.export import export_capture
from digs_warp.interchange.recordings.read import READERS, read_recording
from digs_warp.interchange.recordings.recording import load_depth, nearly_rigid, write_capture
from digs_warp.interchange.recordings.resample import resample_depth, undistort
from digs_warp.log import to_json

WIDTH, HEIGHT = 21, 14
CAMERA = Intrinsics(WIDTH, HEIGHT, fx=19.0, fy=23.0, cx=9.25, cy=7.75)
TIMES = (0.0, 0.25, 1.5)


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """Three noisy frames with a round object and holes in the depth; nothing is symmetric."""
    rng = np.random.default_rng(0)
    writer = CaptureWriter(tmp_path_factory.mktemp("recordings") / "capture", CAMERA)
    u, v = np.moveaxis(pixel_centers(WIDTH, HEIGHT), -1, 0)
    for number, time in enumerate(TIMES):
        depth = rng.uniform(0.6, 6.0, (HEIGHT, WIDTH)).astype(np.float32)
        depth[rng.random(depth.shape) < 0.2] = np.nan
        mask = np.where(np.hypot(u - 8, v - 6) < 5, 255, 0).astype(np.uint8)
        image = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        writer.write_frame(number, FrameImages(image=image, depth=depth, mask=mask))
        eye = np.array([1.0 + number, 0.3 - number, 0.7])
        writer.add_pose(number, look_at(eye, np.zeros(3), np.array([0.1, 0.2, 1.0])), time)
    return writer.finish()


def points(capture: Capture, number: int) -> np.ndarray:
    """World points of all pixels, NaN where depth is unknown."""
    frame = capture.frames[number]
    centers = pixel_centers(WIDTH, HEIGHT)
    return frame.camera.unproject(centers, frame.load_depth().astype(np.float64))


def converted(form: str, source: Path, target: Path) -> Capture:
    return write_capture(read_recording(source, form), form, target)


def check_same(found: Capture, expected: Capture, tolerance: float) -> None:
    """The same photographs, the same points, the same holes."""
    assert len(found) == len(expected)
    for number, (frame, true) in enumerate(zip(found.frames, expected.frames, strict=True)):
        np.testing.assert_array_equal(frame.load_image(), true.load_image())
        np.testing.assert_allclose(points(found, number), points(expected, number), atol=tolerance)


# What the exporters write comes back


@pytest.mark.parametrize(("form", "tolerance"), [("tum", 2e-4), ("redwood", 1e-3), ("bop", 2e-4)])
def test_exports_come_back_as_the_same_points(
    capture: Capture, form: str, tolerance: float, tmp_path: Path
) -> None:
    export_capture(capture, form, tmp_path / form)
    found = converted(form, tmp_path / form, tmp_path / "capture")
    check_same(found, capture, tolerance)
    assert found.knows_poses


def test_masks_and_cameras_of_bop_come_back(capture: Capture, tmp_path: Path) -> None:
    zoomed = replace(capture.frames[2].camera.intrinsics, fx=30.0)
    last = replace(
        capture.frames[2], camera=Camera(zoomed, capture.frames[2].camera.world_from_cam)
    )
    export_capture(replace(capture, frames=(*capture.frames[:2], last)), "bop", tmp_path / "bop")
    found = converted("bop", tmp_path / "bop", tmp_path / "capture")
    assert [frame.camera.intrinsics.fx for frame in found.frames] == [19.0, 19.0, 30.0]
    np.testing.assert_array_equal(found.frames[1].load_mask(), capture.frames[1].load_mask())


def test_our_own_folder_is_a_nerfstudio_recording(capture: Capture, tmp_path: Path) -> None:
    check_same(converted("nerfstudio", capture.folder, tmp_path), capture, 1e-12)


# nerfstudio as others write it


def write_nerfstudio(capture: Capture, folder: Path, **changes: Any) -> dict[str, Any]:
    """JPEG images, no depth, poses as 3D scanners export them: few digits."""
    (folder / "images").mkdir(parents=True)
    frames = []
    for number, frame in enumerate(capture.frames):
        path = folder / "images" / f"frame_{number + 1:05d}.jpg"
        path.write_bytes(encode_jpeg(frame.load_image(), quality=100))
        matrix = np.round(frame.camera.world_from_cam @ OPENCV_FROM_OPENGL, 6)
        frames.append({"file_path": f"images/{path.name}", "transform_matrix": matrix.tolist()})
    index = {
        "camera_model": "OPENCV",
        **{"w": WIDTH, "h": HEIGHT, "fl_x": 19.0, "fl_y": 23.0, "cx": 9.25, "cy": 7.75},
        **{"k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0},
        "applied_transform": [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0]],
        "frames": frames,
    } | changes
    (folder / "transforms.json").write_text(to_json(index))
    return index


def test_nerfstudio_without_depth_is_a_capture_of_images(capture: Capture, tmp_path: Path) -> None:
    write_nerfstudio(capture, tmp_path / "ns")
    found = converted("nerfstudio", tmp_path / "ns", tmp_path / "capture")
    for frame, true in zip(found.frames, capture.frames, strict=True):
        assert frame.camera.intrinsics == CAMERA and not frame.has("depth_file_path")
        np.testing.assert_allclose(
            frame.camera.world_from_cam, true.camera.world_from_cam, atol=1e-5
        )
        assert np.abs(frame.load_image().astype(int) - true.load_image()).mean() < 4


def test_the_scale_that_nerfstudio_applied_is_taken_back(capture: Capture, tmp_path: Path) -> None:
    index = write_nerfstudio(capture, tmp_path / "ns")
    for frame in index["frames"]:
        for row in frame["transform_matrix"][:3]:
            row[3] *= 0.25
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


def test_distortion_is_taken_out() -> None:
    k = Intrinsics(200, 150, 160.0, 165.0, 97.0, 78.0)
    lens = (-0.2, 0.05, 0.002, -0.001)
    # A picture whose value at a pixel says where it lies, to a quarter of a pixel, seen through the lens.
    centers = pixel_centers(200, 150)
    ramp = np.clip(4 * centers[..., 0], 0, 255).astype(np.uint8)
    image = np.repeat(ramp[..., None], 3, axis=2)
    found, depth, mask = undistort(image, np.ones((150, 200), np.float32), ramp, k, lens)
    x, y = (centers[..., 0] - k.cx) / k.fx, (centers[..., 1] - k.cy) / k.fy
    r2 = x**2 + y**2
    k1, k2, p1, p2 = lens
    distorted = x * (1 + k1 * r2 + k2 * r2**2) + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    expected = distorted * k.fx + k.cx
    side = np.s_[15:-15, 8:45]  # where half a pixel in the lens's centre would show
    difference = found[side][..., 0] / 4 - expected[side]
    assert np.abs(difference).max() < 0.4 and abs(difference.mean()) < 0.02
    assert depth is not None and mask is not None
    np.testing.assert_array_equal(mask, found[..., 0])


# ScanNet, Record3D, ZED: written here as their exporters write them


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


def test_scannet_depth_lands_on_the_colour_pixels(
    capture: Capture, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
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


def test_record3d_may_note_a_camera_for_every_frame(capture: Capture, tmp_path: Path) -> None:
    write_record3d(capture, tmp_path / "r3d")
    path = tmp_path / "r3d/metadata.json"
    own = [[19.0, 23.0, 9.25, 7.75], [20.0, 24.0, 9.0, 7.0], [21.0, 25.0, 9.5, 8.0]]
    path.write_text(json.dumps(json.loads(path.read_text()) | {"perFrameIntrinsicCoeffs": own}))
    found = converted("record3d", tmp_path / "r3d", tmp_path / "capture")
    ks = [frame.camera.intrinsics for frame in found.frames]
    assert [[k.fx, k.fy, k.cx, k.cy] for k in ks] == own


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
            assert np.isnan(load_depth(folder / f"depth{number:06d}.npy", 1.0)[0, :3]).all()
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


# Details


def test_depth_of_another_camera_is_sought_along_the_same_ray() -> None:
    rng = np.random.default_rng(3)
    source = Intrinsics(40, 30, 50.0, 50.0, 20.0, 15.0)
    target = Intrinsics(64, 48, 64.0, 66.0, 30.0, 25.0)
    depth = rng.uniform(1, 2, (30, 40)).astype(np.float32)
    found = resample_depth(depth, source, target)
    camera = Camera(source, np.eye(4))
    centers = pixel_centers(64, 48)
    rays = Camera(target, np.eye(4)).unproject(centers, np.ones((48, 64)))
    px, _ = camera.project(rays)
    inside = (px >= 0).all(-1) & (px < [40, 30]).all(-1)
    column, row = np.floor(px[inside]).astype(int).T
    np.testing.assert_array_equal(found[inside], depth[row, column])
    assert np.isnan(found[~inside]).all() and (~inside).any()


def test_poses_of_few_digits_are_made_rigid_and_others_refused() -> None:
    pose = look_at(np.array([1.0, 2.0, 0.5]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    fixed = nearly_rigid(np.round(pose, 3), "pose")
    np.testing.assert_allclose(fixed[:3, :3] @ fixed[:3, :3].T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(fixed, pose, atol=2e-3)
    for wrong in (pose * 1.5, pose @ np.diag([1, 1, -1, 1]), pose * np.nan):
        with pytest.raises(CaptureError, match="pose"):
            nearly_rigid(wrong, "pose")


# Broken folders


@pytest.mark.parametrize("form", READERS)
def test_an_empty_folder_is_no_recording(form: str, tmp_path: Path) -> None:
    with pytest.raises(DigsError, match=str(tmp_path)):
        read_recording(tmp_path, form)
    with pytest.raises(CaptureError, match="no such folder"):
        read_recording(tmp_path / "missing", form)


def test_an_unknown_form_lists_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match="expected one of nerfstudio, tum"):
        read_recording(tmp_path, "kinect")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"camera_model": "OPENCV_FISHEYE"}, "OPENCV_FISHEYE"),
        ({"frames": []}, "lists no frames"),
        ({"w": 640, "h": 480}, r"21x14 pixels, expected 640x480"),
        ({"fl_x": -3.0}, "focal lengths above 0"),
        ({"fl_x": "wide"}, "frame 0"),
    ],
)
def test_nerfstudio_folders_that_cannot_be_used(
    capture: Capture, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    write_nerfstudio(capture, tmp_path / "ns", **changes)
    with pytest.raises(DigsError, match=message):
        converted("nerfstudio", tmp_path / "ns", tmp_path / "capture")


def test_a_missing_image_is_named(capture: Capture, tmp_path: Path) -> None:
    write_nerfstudio(capture, tmp_path / "ns")
    (tmp_path / "ns/images/frame_00002.jpg").unlink()
    with pytest.raises(CaptureError, match=r"frame 1 .*frame_00002\.jpg' does not exist"):
        read_recording(tmp_path / "ns", "nerfstudio")


def test_tum_needs_to_know_its_camera(capture: Capture, tmp_path: Path) -> None:
    export_capture(capture, "tum", tmp_path / "rgbd_dataset_freiburg2_desk")
    (tmp_path / "rgbd_dataset_freiburg2_desk/calibration.txt").unlink()
    recording = read_recording(tmp_path / "rgbd_dataset_freiburg2_desk", "tum")
    assert recording.frames[0].intrinsics.fx == 520.9
    (tmp_path / "rgbd_dataset_freiburg2_desk").rename(tmp_path / "mine")
    with pytest.raises(CaptureError, match=r"write 'fx fy cx cy' into its calibration\.txt"):
        read_recording(tmp_path / "mine", "tum")


def test_tum_without_ground_truth_has_no_poses(capture: Capture, tmp_path: Path) -> None:
    export_capture(capture, "tum", tmp_path / "tum")
    (tmp_path / "tum/groundtruth.txt").unlink()
    assert not converted("tum", tmp_path / "tum", tmp_path / "capture").knows_poses


@pytest.mark.parametrize(
    ("form", "name", "content", "message"),
    [
        ("tum", "rgb.txt", "no numbers here\n", "lines of time and file name"),
        ("tum", "groundtruth.txt", "1 2 3\n", "poses"),
        ("redwood", "camera_intrinsic.json", "{}", "intrinsic_matrix"),
        ("redwood", "trajectory.log", "0 0 1\n1 0 0\n", "trajectory"),
        ("bop", "train/000000/scene_camera.json", "{}", "image 0"),
    ],
)
def test_broken_files_are_named(
    capture: Capture, tmp_path: Path, form: str, name: str, content: str, message: str
) -> None:
    export_capture(capture, form, tmp_path)
    (tmp_path / name).write_text(content)
    with pytest.raises(DigsError, match=message):
        read_recording(tmp_path, form)


# By the command


def test_the_command_converts_a_recording(
    capture: Capture, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export_capture(capture, "tum", tmp_path / "tum")
    arguments = ["convert", str(tmp_path / "tum"), "--from", "tum", "--out", str(tmp_path / "c")]
    assert main(arguments) == 0
    assert "3 frames from tum" in capsys.readouterr().out
    check_same(read_capture(tmp_path / "c"), capture, 2e-4)
    assert main(arguments) == 1
    assert "not empty" in capsys.readouterr().err
    assert main([*arguments, "--overwrite"]) == 0


def test_the_command_says_when_poses_are_unknown(
    capture: Capture, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export_capture(capture, "tum", tmp_path / "tum")
    (tmp_path / "tum/groundtruth.txt").unlink()
    assert main(["convert", str(tmp_path / "tum"), str(tmp_path / "c"), "--from", "tum"]) == 0
    assert "poses unknown" in capsys.readouterr().out


def test_a_recording_is_not_exported_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["convert", str(tmp_path), "--from", "tum", "--to", "colmap", "--out", "x"]
    assert main(arguments) == 2
    assert "--from and --to" in capsys.readouterr().err


# What people really recorded


def test_single_images_of_a_primesense_camera(sample_data: Path, tmp_path: Path) -> None:
    theirs = sample_data / "rgbd/primesense_single_object"
    camera = json.loads((theirs / "intrinsics.json").read_text())
    folder = tmp_path / "zed"
    folder.mkdir()
    for number in range(3):
        (folder / f"left{number}.png").symlink_to(theirs / f"color_{number}.png")
        depth = read_image(theirs / f"depth_{number}.png")[..., 0].astype(np.float32) * 1e-4
        write_image(folder / f"depth{number}.exr", depth)
    k = {key: camera[f"_{key}"] for key in ("fx", "fy", "cx", "cy")}
    (folder / "calibration.json").write_text(json.dumps(k))
    found = converted("zed", folder, tmp_path / "capture")
    frame = found.frames[1]
    assert (frame.camera.intrinsics.width, frame.camera.intrinsics.height) == (640, 480)
    assert 0.5 < np.nanmedian(frame.load_depth()) < 0.9
    assert frame.load_image().std() > 20
