"""Depth of another camera than the images': found on real recordings, and moved by one command."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from digs_warp.check.alignment import Registration, registration, thumbnail_of
from digs_warp.check.check import check_capture
from digs_warp.check.findings import limit_of
from digs_warp.check.thresholds import REGISTRATION_CERTAINTY, REGISTRATION_SIZE
from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.data.capture import read_capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.images import read_image
from digs_warp.data.viewpoints import evenly
from digs_warp.geometry.camera import Intrinsics
from reference.real_captures import recorded

Pair = tuple[np.ndarray, np.ndarray]
PLANES = "d435_planes"
RECORDINGS = ["hololens_room_sequence", "tum_cabinet_orbit", PLANES]
# Shift to the right and down [of the width], and size.
CHANGES = [
    *((0.02, 0.0, 1.0), (0.0, -0.02, 1.0), (-0.05, 0.0, 1.0), (0.1, 0.0, 1.0), (0.0, 0.1, 1.0)),
    *((0.0, 0.0, 0.85), (0.0, 0.0, 0.9), (0.0, 0.0, 1.1), (0.0, 0.0, 1.15), (0.04, 0.02, 1.1)),
]


def pairs(folder: Path, kind: str) -> list[Pair]:
    if kind == PLANES:
        images, depths = (sorted((folder / name).iterdir()) for name in ("color", "depth"))
        both = zip(map(read_image, images), map(read_image, depths), strict=True)
        depth = [(image, d[..., 0].astype(np.float32) / 1000) for image, d in both]
        return [(image, np.where(d > 0, d, np.float32(np.nan))) for image, d in depth]
    frames = evenly(recorded(folder, kind).frames, 16)
    return [(frame.load_image(), frame.load_depth()) for frame in frames]


def changed(depth: np.ndarray, right: float, down: float, size: float) -> np.ndarray:
    """The depth, scaled about the middle and moved; unknown where nothing comes to lie."""
    height, width = depth.shape
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    moved = (1 - size) * middle + np.array([right, down]) * width
    turn = np.column_stack([size * np.eye(2), moved])
    flags = {"flags": cv2.INTER_NEAREST, "borderValue": float("nan")}
    return cv2.warpAffine(depth, turn, (width, height), **flags)


@pytest.mark.parametrize("kind", RECORDINGS)
def test_shifted_and_scaled_depth_is_found(sample_data: Path, kind: str) -> None:
    whole = pairs(sample_data / "rgbd" / kind, kind)
    least, size = limit_of("alignment"), REGISTRATION_SIZE

    def found(change: tuple[float, float, float]) -> Registration:
        moved = [thumbnail_of(image, changed(depth, *change)) for image, depth in whole]
        result = registration(moved)
        assert result is not None and result.certainty > REGISTRATION_CERTAINTY
        return result

    good = found((0.0, 0.0, 1.0))
    assert np.hypot(good.right, good.down) < least and abs(np.log(good.scale)) < size
    for change in CHANGES:
        right, down, scale = change
        back = found(change)
        assert np.hypot(back.right, back.down) > least or abs(np.log(back.scale)) > size, change
        assert back.scale == pytest.approx(good.scale / scale, rel=0.04), change
        # What was scaled first is moved by less.
        assert back.right == pytest.approx(good.right - right / scale, abs=0.012), change
        assert back.down == pytest.approx(good.down - down / scale, abs=0.012), change


def test_things_that_stereo_widened_are_no_finding() -> None:
    """Matching by windows widens what is near, by 8 of 180 px: depth at .95 times its size fits."""
    rng, frames = np.random.default_rng(1), []
    for row, column in rng.integers((40, 100), (110, 200), (16, 2)):
        image, depth = np.full((270, 480, 3), 90, np.uint8), np.full((270, 480), 2.0, np.float32)
        image[row : row + 120, column : column + 180] = 180
        depth[row - 6 : row + 126, column - 6 : column + 186] = 1.0
        frames.append(thumbnail_of(image, depth))
    found = registration(frames)
    assert found is not None and found.certainty > REGISTRATION_CERTAINTY
    assert 0.045 < -np.log(found.scale) < REGISTRATION_SIZE
    assert np.hypot(found.right, found.down) < limit_of("alignment")


@pytest.mark.parametrize("kind", RECORDINGS[:2])
def test_one_command_mends_it(sample_data: Path, tmp_path: Path, kind: str, capsys) -> None:
    capture = recorded(sample_data / "rgbd" / kind, kind)
    frames = evenly(capture.frames, 16)
    writer = CaptureWriter(tmp_path / "moved", frames[0].camera.intrinsics)
    for number, frame in enumerate(frames):
        depth = changed(frame.load_depth(), 0.05, -0.03, 1.1)
        writer.write_frame(number, FrameImages(frame.load_image(), depth))
        writer.add_pose(number, frame.camera.world_from_cam, float(number))
    writer.finish()
    findings = check_capture(read_capture(tmp_path / "moved"), "info").findings
    assert [each.kind for each in findings] == ["alignment"]
    assert "Kinect" in findings[0].what
    arguments = ["convert", tmp_path / "moved", "--from", "nerfstudio", "--register-depth", "found"]
    assert main([*map(str, arguments), "--out", str(tmp_path / "mended")]) == EXIT_OK
    assert check_capture(read_capture(tmp_path / "mended"), "info").findings == ()
    arguments[-1] = tmp_path / "camera.json"
    (tmp_path / "camera.json").write_text('{"w": 540}')
    assert main([*map(str, arguments), "--out", str(tmp_path / "other")]) == EXIT_BAD_INPUT
    assert "camera.json" in capsys.readouterr().err


def test_the_camera_of_moved_depth_undoes_the_move() -> None:
    k = Intrinsics(640, 480, 500.0, 510.0, 310.0, 250.0)
    found = Registration(scale=1.1, right=0.05, down=-0.02, certainty=2.0, at_rim=False)
    point = np.array([0.3, -0.2, 1.0])
    in_image, in_depth = (each.matrix @ point for each in (k, found.depth_camera(k)))
    middle, move = np.array([320, 240]), 640 * np.array([0.05, -0.02])
    np.testing.assert_allclose(middle + 1.1 * (in_depth[:2] - middle) + move, in_image[:2])
