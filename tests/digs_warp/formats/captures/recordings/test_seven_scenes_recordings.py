"""7-Scenes and the data sets in its layout."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.images import write_image
from digs_warp.formats.captures.formats import read_recording
from digs_warp.formats.captures.seven_scenes import COLOR_FROM_DEPTH
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import invert_rigid, look_at
from reference.recorded import HEIGHT, WIDTH, check_same, converted


def write_frames(capture: Capture, folder: Path, unknown: int = 65535) -> None:
    """Millimetres, and another value than 0 for unknown depth; the numbers begin at 7 and have a gap."""
    for number, frame in zip((7, 8, 10), capture.frames, strict=True):
        start = folder / f"frame-{number:06d}"
        write_image(start.with_suffix(".color.png"), frame.load_image())
        depth = np.round(1000 * np.nan_to_num(frame.load_depth(), nan=unknown / 1000))
        write_image(start.with_suffix(".depth.png"), depth.astype(np.uint16))
        np.savetxt(start.with_suffix(".pose.txt"), frame.camera.world_from_cam, fmt="%.7e")


def calibrate(folder: Path) -> None:
    (folder / "camera-intrinsics.txt").write_text("19 0 8.75\n0 23 7.25\n0 0 1\n")


@pytest.fixture
def sequence(capture: Capture, tmp_path: Path) -> Path:
    write_frames(capture, tmp_path / "scene/seq-01")
    return tmp_path / "scene/seq-01"


def test_a_calibration_may_lie_beside_the_sequences(
    capture: Capture, sequence: Path, tmp_path: Path
) -> None:
    calibrate(sequence.parent)
    found = converted("7scenes", sequence, tmp_path / "capture")
    check_same(found, capture, 1e-3)
    assert [frame.time for frame in found.frames] == pytest.approx([0, 1 / 30, 3 / 30])


def test_an_info_file_has_the_cameras_of_color_and_depth_and_the_unit(
    capture: Capture, sequence: Path, tmp_path: Path
) -> None:
    for number, frame in zip((7, 8, 10), capture.frames, strict=True):
        depth = np.nan_to_num(frame.load_depth()).repeat(2, axis=0).repeat(2, axis=1)
        path = sequence / f"frame-{number:06d}.depth.png"
        write_image(path, np.round(5000 * depth).astype(np.uint16))
    (sequence / "_info.txt").write_text(
        "m_versionNumber = 4\nm_depthShift = 5000\n"
        "m_calibrationColorIntrinsic = 19 0 8.75 0 0 23 7.25 0 0 0 1 0 0 0 0 1\n"
        "m_calibrationDepthIntrinsic = 38 0 18 0 0 46 15 0 0 0 1 0 0 0 0 1\n"
    )
    check_same(converted("7scenes", sequence, tmp_path / "capture"), capture, 1e-3)
    (sequence / "info.txt").write_text("m_calibrationColorIntrinsic = 1 2 3\n")
    with pytest.raises(DigsError, match=r"info\.txt'.*4 x 4 numbers"):
        read_recording(sequence, "7scenes")


def test_the_kinect_of_7_scenes_has_its_color_camera_beside_the_depth_camera(
    tmp_path: Path,
) -> None:
    # A wall that the depth camera faces, 2 m away: from the color camera it is a little tilted.
    world_from_depth = look_at(
        np.array([1.0, 2.0, 0.5]), np.array([0.0, 2.0, 0.5]), np.array([0, 0, 1.0])
    )
    write_image(tmp_path / "frame-000000.color.png", np.full((480, 640, 3), 90, np.uint8))
    depth = np.full((480, 640), 2000, np.uint16)
    depth[200:300, 300:400] = 65535
    write_image(tmp_path / "frame-000000.depth.png", depth)
    np.savetxt(tmp_path / "frame-000000.pose.txt", world_from_depth)
    frame = converted("7scenes", tmp_path, tmp_path / "capture").frames[0]
    k = frame.camera.intrinsics
    assert k == Intrinsics(640, 480, 525.0, 525.0, 320.5, 240.5)
    np.testing.assert_allclose(
        frame.camera.world_from_cam, world_from_depth @ invert_rigid(COLOR_FROM_DEPTH), atol=1e-12
    )
    found = frame.load_depth()
    seen = np.isfinite(found)
    rows, columns = np.nonzero(seen)
    points = frame.camera.unproject(np.stack([columns + 0.5, rows + 0.5], axis=1), found[seen])
    np.testing.assert_allclose(points[:, 0], 1.0 - 2.0, atol=2e-3)  # all on the wall
    # The hole is where the color camera sees it, 2.6 cm further left.
    hole = np.argwhere(~seen[100:380, 150:500]) + [100, 150]
    depth_camera = Camera(Intrinsics(640, 480, 585.0, 585.0, 320.5, 240.5), world_from_depth)
    corner = depth_camera.unproject(np.array([[300.0, 200.0]]), np.array([2.0]))
    expected, _ = frame.camera.project(corner)
    np.testing.assert_allclose(hole.min(axis=0)[::-1], expected[0], atol=1.5)


def spoil(name: str, content: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_text(content)


BROKEN: dict[str, tuple[Callable[[Path], object], str]] = {
    "pose of three rows": (spoil("frame-000008.pose.txt", "1 0 0 0\n" * 3), "000008.pose.txt.*16|4, 4"),
    "pose with words": (spoil("frame-000008.pose.txt", "lost " * 16), "frame-000008.pose.txt"),
    "pose that scales": (
        spoil("frame-000008.pose.txt", "2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1"), "no rotation"
    ),
    "calibration": (spoil("camera-intrinsics.txt", "19 8.75\n"), "camera-intrinsics.txt"),
    "negative": (spoil("camera-intrinsics.txt", "-19 0 8 0 23 7 0 0 1\n"), "focal lengths above 0"),
    "depth": (spoil("frame-000008.depth.png", "no image"), "000008.depth.png"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_broken_sequences_are_explained(sequence: Path, tmp_path: Path, name: str) -> None:
    calibrate(sequence)
    change, message = BROKEN[name]
    change(sequence)
    with pytest.raises(DigsError, match=message):
        converted("7scenes", sequence, tmp_path / "capture")


def test_other_cameras_need_a_calibration_and_a_scene_has_sequences(sequence: Path) -> None:
    with pytest.raises(
        DigsError, match=rf"images of {WIDTH}x{HEIGHT} pixels and no camera-intrinsics"
    ):
        read_recording(sequence, "7scenes")
    with pytest.raises(DigsError, match="name one of its sequences: seq-01"):
        read_recording(sequence.parent, "7scenes")
