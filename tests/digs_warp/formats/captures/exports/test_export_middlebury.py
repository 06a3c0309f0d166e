"""Captures as scenes of Middlebury's, and what all exports of stereo pairs ask for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.data.images import read_image
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.formats import export_capture
from reference.exported import assert_exported_alike_twice, exported
from reference.labeled_capture import BASELINE, CAMERA, labeled_capture, without

STEREO = ("kitti-stereo", "sceneflow", "middlebury")


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return labeled_capture(tmp_path_factory.mktemp("middlebury") / "capture", flow=False)


@pytest.fixture(scope="module")
def folder(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return exported(capture, "middlebury", tmp_path_factory.mktemp("middlebury") / "out")


def pfm(path: Path) -> np.ndarray:
    _, size, scale, data = path.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    assert float(scale) < 0
    return np.frombuffer(data, "<f4").reshape(height, width)[::-1]


def calibration(path: Path) -> dict[str, str]:
    return dict(line.split("=", 1) for line in path.read_text().splitlines())  # pyright: ignore


def test_a_scene_has_the_files_of_2014(capture: Capture, folder: Path) -> None:
    for number, frame in enumerate(capture.frames):
        scene = folder / f"{number:04d}"
        assert sorted(path.name for path in scene.iterdir()) == [
            *("calib.txt", "disp0.pfm", "disp1.pfm", "im0.png", "im1.png", "mask0nocc.png")
        ]
        np.testing.assert_array_equal(read_image(scene / "im0.png"), frame.load_image())
        np.testing.assert_array_equal(read_image(scene / "im1.png"), frame.load_right_image())
        left = frame.load_disparity()
        np.testing.assert_array_equal(pfm(scene / "disp0.pfm"), np.nan_to_num(left, nan=np.inf))
        np.testing.assert_array_equal(pfm(scene / "disp1.pfm"), frame.load_disparity_right())
        mask = read_image(scene / "mask0nocc.png")[..., 0]
        known, seen = np.isfinite(left), frame.load_occlusion() == 0
        np.testing.assert_array_equal(mask == 255, known & seen)
        np.testing.assert_array_equal(mask == 128, known & ~seen)
        np.testing.assert_array_equal(mask == 0, ~known)


def test_the_calibration_turns_disparity_into_millimetres(capture: Capture, folder: Path) -> None:
    for number, frame in enumerate(capture.frames):
        found = calibration(folder / f"{number:04d}/calib.txt")
        numbers = [float(word) for word in found["cam0"].strip("[]").replace(";", " ").split()]
        # The center of the first pixel is (0, 0).
        expected = [CAMERA.fx, 0, CAMERA.cx - 0.5, 0, CAMERA.fy, CAMERA.cy - 0.5, 0, 0, 1]
        np.testing.assert_allclose(numbers, expected)
        assert found["cam1"] == found["cam0"] and (found["doffs"], found["isint"]) == ("0", "0")
        assert (found["width"], found["height"]) == (str(CAMERA.width), str(CAMERA.height))
        depth_mm = float(found["baseline"]) * numbers[0] / (9.5 + float(found["doffs"]))
        assert depth_mm == pytest.approx(1000 * CAMERA.fx * BASELINE / 9.5)
        most = np.nanmax(frame.load_disparity())
        assert int(found["ndisp"]) - 1 == int(found["vmax"]) == np.ceil(most)
        assert int(found["vmin"]) == np.floor(np.nanmin(frame.load_disparity()))


def test_torchvision_reads_a_scene(capture: Capture, folder: Path, tmp_path: Path) -> None:
    datasets = pytest.importorskip("torchvision.datasets", reason="torchvision is not installed")
    # It knows the scenes of 2014 by name.
    (tmp_path / "Middlebury2014/train").mkdir(parents=True)
    (tmp_path / "Middlebury2014/train/Motorcycle-perfect").symlink_to(folder / "0001")
    ((left, right, disparity, known),) = list(datasets.Middlebury2014Stereo(tmp_path))
    frame = capture.frames[1]
    np.testing.assert_array_equal(np.asarray(left), frame.load_image())
    np.testing.assert_array_equal(np.asarray(right), frame.load_right_image())
    true = frame.load_disparity()
    np.testing.assert_array_equal(known, np.isfinite(true))
    np.testing.assert_array_equal(disparity[0][known], true[known])


@pytest.mark.parametrize("form", STEREO)
def test_a_capture_without_labels_says_how_to_get_them(
    capture: Capture, form: str, tmp_path: Path
) -> None:
    for layer in (Layer.OCCLUSION, Layer.DISPARITY_RIGHT, Layer.RIGHT):
        with pytest.raises(CaptureError, match=rf"'0002'.*{layer.value}.*--labels disparity"):
            export_capture(without(capture, layer), form, tmp_path / "out")
    with pytest.raises(CaptureError, match="one eye"):
        export_capture(replace(capture, rig=None), form, tmp_path / "out")


@pytest.mark.parametrize("form", STEREO)
def test_exports_of_pairs_do_not_depend_on_their_threads(
    capture: Capture, form: str, tmp_path: Path
) -> None:
    assert assert_exported_alike_twice(capture, form, tmp_path) > 10


@pytest.mark.parametrize("form", STEREO)
def test_a_capture_in_memory_is_exported_as_a_folder_is(
    capture: Capture, form: str, tmp_path: Path
) -> None:
    """Images that are no PNG files are converted."""
    frames = [
        replace(
            frame,
            layers={
                **frame.layers,
                Layer.IMAGE: frame.load_image(),
                Layer.RIGHT: frame.load_right_image(),
            },
        )
        for frame in capture.frames
    ]
    folder = exported(replace(capture, frames=tuple(frames)), form, tmp_path / "out")
    left = sorted(folder.rglob("im0.png")) or sorted(
        path for path in folder.rglob("*.png") if path.parent.name in ("left", "image_2")
    )
    assert len(left) == len(frames)
    for path, frame in zip(left, capture.frames, strict=True):
        np.testing.assert_array_equal(read_image(path), frame.load_image())
