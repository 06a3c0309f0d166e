"""Captures as sets of stereo pairs: Middlebury, FlyingThings3D and KITTI, read as their users read them."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.data.images import read_image
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.formats import export_capture
from digs_warp.formats.captures.stereo import calib_cam_to_cam, encode_disparity, encode_flow
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from reference.exported import exported
from reference.labeled_capture import BASELINE, CAMERA, EYES, labeled_capture, without

STEREO = ("kitti-stereo", "sceneflow", "middlebury")


@pytest.fixture(scope="module")
def scenes(pairs: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return exported(pairs, "middlebury", tmp_path_factory.mktemp("middlebury") / "out")


@pytest.fixture(scope="module")
def flying(pairs: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return exported(pairs, "sceneflow", tmp_path_factory.mktemp("sceneflow") / "out")


@pytest.fixture(scope="module")
def training(pairs: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return exported(pairs, "kitti-stereo", tmp_path_factory.mktemp("kitti") / "out") / "training"


def read_pfm(path: Path) -> np.ndarray:
    """From the text of the format: three lines, then rows from bottom to top."""
    kind, size, scale, data = path.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    assert float(scale) == -1.0  # below zero: little-endian
    pixels = np.frombuffer(data, "<f4").reshape(height, width, {b"Pf": 1, b"PF": 3}[kind])
    return pixels[::-1]


# Middlebury


def calibration(path: Path) -> dict[str, str]:
    return dict(line.split("=", 1) for line in path.read_text().splitlines())  # pyright: ignore


def test_a_scene_has_the_files_of_2014(pairs: Capture, scenes: Path) -> None:
    for number, frame in enumerate(pairs.frames):
        scene = scenes / f"{number:04d}"
        assert sorted(path.name for path in scene.iterdir()) == [
            *("calib.txt", "disp0.pfm", "disp1.pfm", "im0.png", "im1.png", "mask0nocc.png")
        ]
        np.testing.assert_array_equal(read_image(scene / "im0.png"), frame.load_image())
        np.testing.assert_array_equal(read_image(scene / "im1.png"), frame.load_right_image())
        left = frame.load(Layer.DISPARITY)
        np.testing.assert_array_equal(
            read_pfm(scene / "disp0.pfm")[..., 0], np.nan_to_num(left, nan=np.inf)
        )
        np.testing.assert_array_equal(
            read_pfm(scene / "disp1.pfm")[..., 0], frame.load(Layer.DISPARITY_RIGHT)
        )
        mask = read_image(scene / "mask0nocc.png")[..., 0]
        known, seen = np.isfinite(left), frame.load(Layer.OCCLUSION) == 0
        np.testing.assert_array_equal(mask == 255, known & seen)
        np.testing.assert_array_equal(mask == 128, known & ~seen)
        np.testing.assert_array_equal(mask == 0, ~known)


def test_the_calibration_turns_disparity_into_millimetres(pairs: Capture, scenes: Path) -> None:
    for number, frame in enumerate(pairs.frames):
        found = calibration(scenes / f"{number:04d}/calib.txt")
        numbers = [float(word) for word in found["cam0"].strip("[]").replace(";", " ").split()]
        # The center of the first pixel is (0, 0).
        expected = [CAMERA.fx, 0, CAMERA.cx - 0.5, 0, CAMERA.fy, CAMERA.cy - 0.5, 0, 0, 1]
        np.testing.assert_allclose(numbers, expected)
        assert found["cam1"] == found["cam0"] and (found["doffs"], found["isint"]) == ("0", "0")
        assert (found["width"], found["height"]) == (str(CAMERA.width), str(CAMERA.height))
        depth_mm = float(found["baseline"]) * numbers[0] / (9.5 + float(found["doffs"]))
        assert depth_mm == pytest.approx(1000 * CAMERA.fx * BASELINE / 9.5)
        most = np.nanmax(frame.load(Layer.DISPARITY))
        assert int(found["ndisp"]) - 1 == int(found["vmax"]) == np.ceil(most)
        assert int(found["vmin"]) == np.floor(np.nanmin(frame.load(Layer.DISPARITY)))


@pytest.mark.parametrize("form", STEREO)
def test_a_capture_without_labels_says_how_to_get_them(
    pairs: Capture, form: str, tmp_path: Path
) -> None:
    for layer in (Layer.OCCLUSION, Layer.DISPARITY_RIGHT, Layer.RIGHT):
        with pytest.raises(CaptureError, match=rf"'0002'.*{layer.value}.*--labels disparity"):
            export_capture(without(pairs, layer), form, tmp_path / "out")
    with pytest.raises(CaptureError, match="one eye"):
        export_capture(replace(pairs, rig=None), form, tmp_path / "out")


# FlyingThings3D


DATA = "SceneFlow/FlyingThings3D"
FUTURE = "TRAIN/A/0000/into_future/left"


def test_disparity_flow_and_change_come_back(pairs: Capture, flying: Path) -> None:
    for number, frame in enumerate(pairs.frames):
        left, right = frame.load(Layer.DISPARITY), frame.load(Layer.DISPARITY_RIGHT)
        for side, true in (("left", np.nan_to_num(left, nan=0.0)), ("right", right)):
            path = flying / DATA / f"disparity/TRAIN/A/0000/{side}/{number:04d}.pfm"
            np.testing.assert_array_equal(read_pfm(path)[..., 0], true)
        name = f"OpticalFlowIntoFuture_{number:04d}_L.pfm"
        flow = flying / DATA / "optical_flow" / FUTURE / name
        change = flying / DATA / "disparity_change" / FUTURE / f"{number:04d}.pfm"
        if number + 1 == len(pairs):
            assert not flow.exists() and not change.exists()
            continue
        known = np.isfinite(frame.load(Layer.FLOW)[..., 2])
        assert not known.all()
        found = read_pfm(flow)
        np.testing.assert_array_equal(found[known][:, :2], frame.load(Layer.FLOW)[..., :2][known])
        assert not found[known][:, 2].any() and (found[~known] > 1e9).all()
        found = read_pfm(change)[..., 0]
        np.testing.assert_array_equal(found[known], frame.load(Layer.FLOW)[..., 2][known])
        assert (found[~known] > 1e9).all()


def test_the_cameras_look_where_they_did(pairs: Capture, flying: Path) -> None:
    text = (flying / DATA / "camera_data/TRAIN/A/0000/camera_data.txt").read_text()
    entries = [entry.splitlines() for entry in text.strip().split("\n\n")]
    assert [entry[0] for entry in entries] == ["Frame 0", "Frame 1", "Frame 2"]
    for entry, frame in zip(entries, pairs.frames, strict=True):
        left, right = (np.array(line.split()[1:], float).reshape(4, 4) for line in entry[1:])
        seen = Camera(CAMERA, left @ OPENCV_FROM_OPENGL)
        np.testing.assert_allclose(seen.world_from_cam, frame.camera.world_from_cam, atol=1e-7)
        np.testing.assert_allclose(right[:3, 3] - left[:3, 3], BASELINE * left[:3, 0], atol=1e-7)


# KITTI


def disparity_of(path: Path) -> np.ndarray:
    """As RAFT-Stereo reads it."""
    pixels = cv2.imread(str(path), cv2.IMREAD_ANYDEPTH)
    assert pixels is not None
    return pixels / 256.0


def flow_of(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """As RAFT reads it: OpenCV turns the channels around."""
    pixels = cv2.imread(str(path), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR)
    assert pixels is not None and pixels.dtype == np.uint16
    channels = pixels[:, :, ::-1].astype(np.float32)
    return (channels[:, :, :2] - 2**15) / 64.0, channels[:, :, 2]


def test_numbers_are_those_of_the_development_kit() -> None:
    disparity = np.array([[np.nan, 0.0009, 1.0, 63.501, 255.998, 256.0, -0.2]], np.float32)
    encoded, lost = encode_disparity(disparity)
    np.testing.assert_array_equal(encoded, [[0, 1, 256, 16256, 65535, 0, 0]])
    assert encoded.dtype == np.uint16 and lost == 2
    flow = np.array([[[0.0, 1.0], [-512.0, 511.98], [512.0, 0], [np.nan, 0]]], np.float32)
    encoded, lost = encode_flow(flow)
    expected = [[[32768, 32832, 1], [0, 65535, 1], [0, 0, 0], [0, 0, 0]]]
    np.testing.assert_array_equal(encoded, expected)
    assert encoded.dtype == np.uint16 and lost == 1


def test_disparity_comes_back(pairs: Capture, training: Path) -> None:
    for number, frame in enumerate(pairs.frames[:-1]):
        name, true = f"{number:06d}_10.png", frame.load(Layer.DISPARITY)
        known = np.isfinite(true)
        every, both = (
            disparity_of(training / f"disp_{which}_0" / name) for which in ("occ", "noc")
        )
        np.testing.assert_array_equal(every > 0, known)
        np.testing.assert_allclose(every[known], true[known], atol=0.501 / 256)
        seen = known & (frame.load(Layer.OCCLUSION) == 0)
        np.testing.assert_array_equal(both, np.where(seen, every, 0))
        later = disparity_of(training / "disp_occ_1" / name)
        then = true + frame.load(Layer.FLOW)[..., 2]
        inside = np.isfinite(then) & (then > 0) & (then < 255)
        np.testing.assert_allclose(later[inside], then[inside], atol=0.501 / 256)
        assert inside.sum() > 100 and not later[~inside].any()


def test_flow_comes_back(pairs: Capture, training: Path) -> None:
    for number, frame in enumerate(pairs.frames[:-1]):
        name, true = f"{number:06d}_10.png", frame.load(Layer.FLOW)[..., :2]
        flow, known = flow_of(training / "flow_occ" / name)
        np.testing.assert_array_equal(known, np.isfinite(true).all(axis=-1))
        np.testing.assert_allclose(flow[known == 1], true[known == 1], atol=0.501 / 64)
        flow, seen = flow_of(training / "flow_noc" / name)
        np.testing.assert_array_equal(seen, known * (frame.load(Layer.FLOW_OCCLUSION) == 0))
        np.testing.assert_allclose(flow[seen == 1], true[seen == 1], atol=0.501 / 64)


def test_a_scene_is_a_frame_and_the_next_one(pairs: Capture, training: Path) -> None:
    for eye, load in (("image_2", "load_image"), ("image_3", "load_right_image")):
        names = sorted(path.name for path in (training / eye).iterdir())
        assert names == [f"00000{scene}_1{moment}.png" for scene in (0, 1) for moment in (0, 1)]
        for number in (0, 1):
            for later in (0, 1):
                found = read_image(training / eye / f"00000{number}_1{later}.png")
                expected = getattr(pairs.frames[number + later], load)()
                np.testing.assert_array_equal(found, expected)


def test_without_flow_every_frame_is_a_scene(tmp_path: Path) -> None:
    """And images that are no PNG files become some."""
    capture = labeled_capture(tmp_path / "capture", flow=False)
    image = capture.frames[0].load_image()
    first = capture.frames[0].with_layer(Layer.IMAGE, image)
    capture = replace(capture, frames=(first, *capture.frames[1:]))
    training = exported(capture, "kitti-stereo", tmp_path / "out") / "training"
    names = sorted(path.name for path in (training / "disp_occ_0").iterdir())
    assert names == ["000000_10.png", "000001_10.png", "000002_10.png"]
    np.testing.assert_array_equal(read_image(training / "image_2/000000_10.png"), image)
    assert sorted(path.name for path in training.iterdir()) == [
        *("calib_cam_to_cam", "disp_noc_0", "disp_occ_0", "image_2", "image_3")
    ]


def read_calibration(text: str) -> dict[str, np.ndarray]:
    """As pykitti reads it."""
    rows = (line.split(":", 1) for line in text.splitlines())
    return {name: np.array([float(word) for word in words.split()]) for name, words in rows}


def test_the_calibration_projects_into_both_eyes(training: Path) -> None:
    found = read_calibration((training / "calib_cam_to_cam/000001.txt").read_text())
    left, right = (found[f"P_rect_0{number}"].reshape(3, 4) for number in (2, 3))
    point = np.array([0.3, -0.2, 2.0, 1.0])
    here, there = ((p @ point)[:2] / (p @ point)[2] for p in (left, right))
    # The center of the first pixel is (0, 0).
    expected = [CAMERA.fx * 0.15 + CAMERA.cx - 0.5, CAMERA.fy * -0.1 + CAMERA.cy - 0.5]
    np.testing.assert_allclose(here, expected)
    np.testing.assert_allclose(here - there, [CAMERA.fx * BASELINE / 2.0, 0], atol=1e-12)
    np.testing.assert_array_equal(found["S_rect_02"], [CAMERA.width, CAMERA.height])
    assert calib_cam_to_cam(CAMERA, BASELINE).count("\n") == 16


def test_values_that_do_not_fit_are_told(pairs: Capture, tmp_path: Path, caplog) -> None:
    exported(pairs, "kitti-stereo", tmp_path)
    lost = sum(
        encode_disparity(frame.load(Layer.DISPARITY) + change)[1]
        for frame in pairs.frames[:-1]
        for change in (0, frame.load(Layer.FLOW)[..., 2])
    )
    assert lost > 2 and f"{lost} values outside are written as unknown" in caplog.text


def test_an_infrared_pair_is_a_stereo_pair(tmp_path: Path) -> None:
    capture = labeled_capture(tmp_path / "capture", infrared=True)
    training = exported(capture, "kitti-stereo", tmp_path / "out") / "training"
    left, right = capture.frames[1].load_infrared()
    for eye, pixels in (("image_2", left), ("image_3", right)):
        np.testing.assert_array_equal(read_image(training / eye / "000001_10.png")[..., 0], pixels)
    assert not (training / "flow_occ").exists()  # that is the color camera's
    found = read_calibration((training / "calib_cam_to_cam/000000.txt").read_text())
    np.testing.assert_allclose(found["P_rect_02"][[0, 2]], [EYES.fl_x, EYES.cx - 0.5])
