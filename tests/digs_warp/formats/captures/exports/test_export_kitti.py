"""Captures as KITTI's benchmark of 2015, read as its development kit and its users read it."""

import logging
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.images import read_image
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.kitti import calib_cam_to_cam, encode_disparity, encode_flow
from reference.exported import exported
from reference.labeled_capture import BASELINE, CAMERA, EYES, labeled_capture


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return labeled_capture(tmp_path_factory.mktemp("kitti") / "capture")


@pytest.fixture(scope="module")
def training(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return exported(capture, "kitti-stereo", tmp_path_factory.mktemp("kitti") / "out") / "training"


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


def test_disparity_comes_back(capture: Capture, training: Path) -> None:
    for number, frame in enumerate(capture.frames[:-1]):
        name, true = f"{number:06d}_10.png", frame.load_disparity()
        known = np.isfinite(true)
        every, both = (
            disparity_of(training / f"disp_{which}_0" / name) for which in ("occ", "noc")
        )
        np.testing.assert_array_equal(every > 0, known)
        np.testing.assert_allclose(every[known], true[known], atol=0.501 / 256)
        seen = known & (frame.load_occlusion() == 0)
        np.testing.assert_array_equal(both, np.where(seen, every, 0))
        later = disparity_of(training / "disp_occ_1" / name)
        then = true + frame.load_disparity_change()
        inside = np.isfinite(then) & (then > 0) & (then < 255)
        np.testing.assert_allclose(later[inside], then[inside], atol=0.501 / 256)
        assert inside.sum() > 100 and not later[~inside].any()


def test_flow_comes_back(capture: Capture, training: Path) -> None:
    for number, frame in enumerate(capture.frames[:-1]):
        name, true = f"{number:06d}_10.png", frame.load_flow()
        flow, known = flow_of(training / "flow_occ" / name)
        np.testing.assert_array_equal(known, np.isfinite(true).all(axis=-1))
        np.testing.assert_allclose(flow[known == 1], true[known == 1], atol=0.501 / 64)
        flow, seen = flow_of(training / "flow_noc" / name)
        np.testing.assert_array_equal(seen, known * (frame.load_flow_occlusion() == 0))
        np.testing.assert_allclose(flow[seen == 1], true[seen == 1], atol=0.501 / 64)


def test_a_scene_is_a_frame_and_the_next_one(capture: Capture, training: Path) -> None:
    for eye, load in (("image_2", "load_image"), ("image_3", "load_right_image")):
        names = sorted(path.name for path in (training / eye).iterdir())
        assert names == [f"00000{scene}_1{moment}.png" for scene in (0, 1) for moment in (0, 1)]
        for number in (0, 1):
            for later in (0, 1):
                found = read_image(training / eye / f"00000{number}_1{later}.png")
                expected = getattr(capture.frames[number + later], load)()
                np.testing.assert_array_equal(found, expected)


def test_without_flow_every_frame_is_a_scene(tmp_path: Path) -> None:
    capture = labeled_capture(tmp_path / "capture", flow=False)
    training = exported(capture, "kitti-stereo", tmp_path / "out") / "training"
    names = sorted(path.name for path in (training / "disp_occ_0").iterdir())
    assert names == ["000000_10.png", "000001_10.png", "000002_10.png"]
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


def test_values_that_do_not_fit_are_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    capture = labeled_capture(tmp_path / "capture")
    disparity = capture.frames[0].load_disparity()
    disparity[5, 5] = 300.0
    near = capture.frames[0].with_layer(Layer.DISPARITY, disparity)
    capture = replace(capture, frames=(near, *capture.frames[1:]))
    with caplog.at_level(logging.WARNING, logger="digs_warp"):
        exported(capture, "kitti-stereo", tmp_path / "out")
    assert "values outside are written as unknown" in caplog.text


def test_an_infrared_pair_is_a_stereo_pair(tmp_path: Path) -> None:
    capture = labeled_capture(tmp_path / "capture", infrared=True)
    training = exported(capture, "kitti-stereo", tmp_path / "out") / "training"
    left, right = capture.frames[1].load_infrared()
    for eye, pixels in (("image_2", left), ("image_3", right)):
        np.testing.assert_array_equal(read_image(training / eye / "000001_10.png")[..., 0], pixels)
    assert not (training / "flow_occ").exists()  # that is the color camera's
    found = read_calibration((training / "calib_cam_to_cam/000000.txt").read_text())
    np.testing.assert_allclose(found["P_rect_02"][[0, 2]], [EYES.fl_x, EYES.cx - 0.5])


def test_torchvision_reads_the_flow(capture: Capture, training: Path, tmp_path: Path) -> None:
    datasets = pytest.importorskip("torchvision.datasets", reason="torchvision is not installed")
    (tmp_path / "KittiFlow").symlink_to(training.parent)
    found = datasets.KittiFlow(tmp_path)
    assert len(found) == 2
    for number, frame in enumerate(capture.frames[:-1]):
        image, later, flow, known = found[number]
        np.testing.assert_array_equal(np.asarray(image), frame.load_image())
        np.testing.assert_array_equal(np.asarray(later), capture.frames[number + 1].load_image())
        true = np.moveaxis(frame.load_flow(), -1, 0)
        np.testing.assert_array_equal(known, np.isfinite(true).all(axis=0))
        where = np.asarray(known, bool)
        np.testing.assert_allclose(flow[:, where], true[:, where], atol=0.501 / 64)
