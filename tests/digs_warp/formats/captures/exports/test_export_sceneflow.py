"""Captures as FlyingThings3D, read back by torchvision, OpenCV and a reader from the format's text."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.formats.captures.stereo_pair import write_pfm
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from reference.exported import exported
from reference.labeled_capture import BASELINE, CAMERA, labeled_capture

DATA = "SceneFlow/FlyingThings3D"
FUTURE = "TRAIN/A/0000/into_future/left"


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return labeled_capture(tmp_path_factory.mktemp("sceneflow") / "capture")


@pytest.fixture(scope="module")
def folder(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return exported(capture, "sceneflow", tmp_path_factory.mktemp("sceneflow") / "out")


def read_pfm(path: Path) -> np.ndarray:
    """From the text of the format: three lines, then rows from bottom to top."""
    kind, size, scale, data = path.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    assert float(scale) == -1.0  # below zero: little-endian
    pixels = np.frombuffer(data, "<f4").reshape(height, width, {b"Pf": 1, b"PF": 3}[kind])
    return pixels[::-1]


def test_pfm_has_the_bytes_of_the_format(tmp_path: Path) -> None:
    path = tmp_path / "a.pfm"
    write_pfm(path, np.array([[1.0, 2.0], [3.0, np.inf]], np.float32))
    last_row_first = np.array([3.0, np.inf, 1.0, 2.0], "<f4").tobytes()
    assert path.read_bytes() == b"Pf\n2 2\n-1.0\n" + last_row_first


def test_opencv_reads_the_float_images(capture: Capture, folder: Path) -> None:
    path = folder / DATA / "disparity/TRAIN/A/0000/right/0001.pfm"
    found = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(found, capture.frames[1].load_disparity_right())


def test_disparity_flow_and_change_come_back(capture: Capture, folder: Path) -> None:
    for number, frame in enumerate(capture.frames):
        left, right = frame.load_disparity(), frame.load_disparity_right()
        for side, true in (("left", np.nan_to_num(left, nan=0.0)), ("right", right)):
            path = folder / DATA / f"disparity/TRAIN/A/0000/{side}/{number:04d}.pfm"
            np.testing.assert_array_equal(read_pfm(path)[..., 0], true)
        name = f"OpticalFlowIntoFuture_{number:04d}_L.pfm"
        flow = folder / DATA / "optical_flow" / FUTURE / name
        change = folder / DATA / "disparity_change" / FUTURE / f"{number:04d}.pfm"
        if number + 1 == len(capture):
            assert not flow.exists() and not change.exists()
            continue
        known = np.isfinite(frame.load_disparity_change())
        assert not known.all()
        found = read_pfm(flow)
        np.testing.assert_array_equal(found[known][:, :2], frame.load_flow()[known])
        assert not found[known][:, 2].any() and (found[~known] > 1e9).all()
        found = read_pfm(change)[..., 0]
        np.testing.assert_array_equal(found[known], frame.load_disparity_change()[known])
        assert (found[~known] > 1e9).all()


def test_the_cameras_look_where_they_did(capture: Capture, folder: Path) -> None:
    text = (folder / DATA / "camera_data/TRAIN/A/0000/camera_data.txt").read_text()
    entries = [entry.splitlines() for entry in text.strip().split("\n\n")]
    assert [entry[0] for entry in entries] == ["Frame 0", "Frame 1", "Frame 2"]
    for entry, frame in zip(entries, capture.frames, strict=True):
        left, right = (np.array(line.split()[1:], float).reshape(4, 4) for line in entry[1:])
        seen = Camera(CAMERA, left @ OPENCV_FROM_OPENGL)
        np.testing.assert_allclose(seen.world_from_cam, frame.camera.world_from_cam, atol=1e-7)
        np.testing.assert_allclose(right[:3, 3] - left[:3, 3], BASELINE * left[:3, 0], atol=1e-7)


def test_torchvision_reads_pairs_and_flow(capture: Capture, folder: Path, tmp_path: Path) -> None:
    datasets = pytest.importorskip("torchvision.datasets", reason="torchvision is not installed")
    pairs = datasets.SceneFlowStereo(folder, pass_name="final")
    assert len(pairs) == len(capture)
    for number, frame in enumerate(capture.frames):
        left, right, disparity = pairs[number]
        np.testing.assert_array_equal(np.asarray(left), frame.load_image())
        np.testing.assert_array_equal(np.asarray(right), frame.load_right_image())
        true = np.nan_to_num(frame.load_disparity(), nan=0.0)
        np.testing.assert_array_equal(disparity, true[None])
    moving = datasets.FlyingThings3D(folder / "SceneFlow", pass_name="final")
    image, later, flow = moving[0]  # torchvision leaves out the last pair
    np.testing.assert_array_equal(np.asarray(image), capture.frames[0].load_image())
    np.testing.assert_array_equal(np.asarray(later), capture.frames[1].load_image())
    true = np.moveaxis(capture.frames[0].load_flow(), -1, 0)
    known = np.isfinite(true)
    np.testing.assert_array_equal(flow[known], true[known])
