"""Printed boards give poses in metres, as several programs print them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from cv2 import aruco

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at, turn_degrees
from digs_warp.pipeline.config import FrontEndConfig
from digs_warp.pipeline.front_end import _with_poses
from digs_warp.poses.board import posed_by_board, read_board
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.record.run_log import RunLog

K = Intrinsics(960, 720, 900.0, 900.0, 480.0, 360.0)
PER_M = 2000  # pixels of the print


def charuco(legacy: bool) -> tuple[str, np.ndarray]:
    board = aruco.CharucoBoard((6, 4), 0.04, 0.03, aruco.getPredefinedDictionary(aruco.DICT_5X5_50))
    board.setLegacyPattern(legacy)
    text = "type: charuco\ncolumns: 6\nrows: 4\nsquare: 0.04\nmarker: 0.03\ndictionary: DICT_5X5_50"
    return text, board.generateImage((480, 320))


GRID = "target_type: 'aprilgrid'\ntagCols: {}\ntagRows: {}\ntagSize: 0.04\ntagSpacing: 0.3\n"


def tags(kalibr: bool) -> tuple[str, np.ndarray]:
    """Kalibr: rows upward, a border of two bits, tags turned by half a turn."""
    tag, gap, columns, rows = 80, 24, 4, 3
    image = np.full((rows * (tag + gap) - gap, columns * (tag + gap) - gap), 255, np.uint8)
    dictionary = aruco.getPredefinedDictionary(aruco.DICT_APRILTAG_36h11)
    for row in range(rows):
        for column in range(columns):
            number = (rows - 1 - row if kalibr else row) * columns + column
            drawn = aruco.generateImageMarker(dictionary, number, tag, borderBits=1 + kalibr)
            y, x = row * (tag + gap), column * (tag + gap)
            image[y : y + tag, x : x + tag] = drawn[::-1, ::-1] if kalibr else drawn
    return GRID.format(columns, rows), image


BOARDS: dict[str, Callable[[], tuple[str, np.ndarray]]] = {
    "charuco": lambda: charuco(False),
    "charuco of before": lambda: charuco(True),
    "tags": lambda: tags(False),
    "tags of Kalibr": lambda: tags(True),
}


def photographed(image: np.ndarray) -> list[Frame]:
    """Eight photographs of a print whose lower left corner is the origin; poses are true."""
    height, width = image.shape
    middle = np.array([width, height, 0]) / PER_M / 2
    frames = []
    for number in range(8):
        angle = 2 * np.pi * number / 8
        eye = middle + [0.25 * np.cos(angle), 0.25 * np.sin(angle), 0.4]
        pose = look_at(eye, middle, np.array([0.0, 0.0, 1.0]))
        cam = np.linalg.inv(pose)
        # From pixels of the print, whose centers are whole in OpenCV, to the world.
        world = np.array([[1, 0, 0.5], [0, -1, height - 0.5], [0, 0, PER_M]]) / PER_M
        matrix = K.matrix.copy()
        matrix[:2, 2] -= 0.5
        view = matrix @ np.column_stack([cam[:3, 0], cam[:3, 1], cam[:3, 3]]) @ world
        size, flags = (K.width, K.height), cv2.INTER_LINEAR
        seen = cv2.warpPerspective(image, view, size, flags=flags, borderValue=255)
        rgb = np.repeat(seen[..., None], 3, axis=2)
        frames.append(Frame(str(number), Camera(K, pose), float(number), {Layer.IMAGE: rgb}))
    return frames


@pytest.mark.parametrize("name", BOARDS)
def test_a_board_gives_poses_in_metres(tmp_path: Path, name: str) -> None:
    text, image = BOARDS[name]()
    (tmp_path / "board.yaml").write_text(text)
    true = photographed(image)
    lost = replace(
        true[0], name="nothing", layers={Layer.IMAGE: np.full((720, 960, 3), 255, np.uint8)}
    )
    blank = [replace(f, camera=Camera(K, np.eye(4))) for f in (*true, lost)]
    found = posed_by_board(blank, tmp_path / "board.yaml")
    assert [frame.name for frame in found] == [frame.name for frame in true]
    poses, truth = (np.stack([f.camera.world_from_cam for f in some]) for some in (found, true))
    if "Kalibr" in name:  # which way is up on the paper, nobody can know of turned tags
        poses = truth[0] @ np.linalg.inv(poses[0]) @ poses
    assert 1e3 * np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1).max() < 2.0
    assert turn_degrees(poses[:, :3, :3], truth[:, :3, :3]).max() < 0.3


def test_the_run_takes_them(tmp_path: Path) -> None:
    text, image = charuco(False)
    (tmp_path / "board.yaml").write_text(text)
    config = FrontEndConfig(sfm=SfmConfig(poses=f"board:{tmp_path / 'board.yaml'}"))
    capture = Capture(None, tuple(photographed(image)), None)
    found, _, _ = _with_poses(capture, config, tmp_path, RunLog("test", {}))
    assert len(found) == 8 and found.knows_poses and found.about.poses_in_metres


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("type: chess", "expected 'type: charuco', or Kalibr's"),
        ("type: charuco\ncolumns: 5\nrows: 4\nsquare: 0.02\nmarker: 0.03", "0 < marker < square"),
        (GRID.format(2, 2) + "dictionary: DICT_7", "did you mean"),
        (GRID.format(0, 2), "a whole number, 1 to 100"),
    ],
)
def test_what_is_no_board_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "board.yaml").write_text(text)
    with pytest.raises(DigsError, match=said):
        read_board(tmp_path / "board.yaml")


def test_photographs_of_something_else_are_refused(tmp_path: Path) -> None:
    (tmp_path / "board.yaml").write_text(tags(False)[0])
    with pytest.raises(DigsError, match=r"0 frames of 8 show the board.*Are dictionary"):
        posed_by_board(photographed(charuco(False)[1]), tmp_path / "board.yaml")


def test_other_ways_are_refused_with_the_known_ones() -> None:
    with pytest.raises(DigsError, match="did you mean 'rgbd'"):
        SfmConfig(poses="rgb")
