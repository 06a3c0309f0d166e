"""Poses from a printed board of markers, AprilTags or ChArUco, in metres: the board is the world.

The file of a board is YAML, with lengths in metres: Kalibr's for AprilTags, or that of a ChArUco board,

    {target_type: aprilgrid, tagCols: 6, tagRows: 4, tagSize: 0.03, tagSpacing: 0.3}
    {type: charuco, columns: 8, rows: 6, square: 0.03, marker: 0.022, dictionary: DICT_5X5_100}

x points along the rows, y up on the paper, z out of it. How tags are turned and in which order their rows are
numbered differs between programs: the way that fits most photographs is taken.
"""

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame, posed_at
from digs_warp.device.threads import default_threads
from digs_warp.geometry.rigid import invert_rigid, rigid
from digs_warp.poses import thresholds
from digs_warp.record.fields import Fields
from digs_warp.record.files import read_yaml
from digs_warp.words import counted, did_you_mean, first_few

logger = logging.getLogger(__name__)

# Of a flag: what stands before the name of the file.
BOARD = "board:"

# Points of a board in a photograph [px], (n, 2), and which they are: numbers of corners, or of tags times 4.
Seen = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Board:
    """A board.

    Attributes:
        find: its points in a gray photograph.
        layouts: where they may be on the board [m]: of each way, by number, (n, 3).
    """

    find: Callable[[np.ndarray], Seen]
    layouts: tuple[dict[int, np.ndarray], ...]


def posed_by_board(frames: Sequence[Frame], path: Path) -> list[Frame]:
    """Return the frames that see enough of the board, with their poses before it.

    Raises:
        DigsError: the file cannot be read, or fewer than three frames see the board.
    """
    import cv2

    def points(frame: Frame) -> Seen:
        image = replace(frame, alone=False).load_image()
        return board.find(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))

    board = read_board(path)
    with ThreadPoolExecutor(default_threads()) as pool:
        seen = [*pool.map(points, frames)]
    tried = [
        [_pose(f, s, layout) for f, s in zip(frames, seen, strict=True)] for layout in board.layouts
    ]
    found = max(tried, key=lambda poses: sum(pose is not None for pose in poses))
    poses = {number: pose for number, pose in enumerate(found) if pose is not None}
    posed = posed_at([frames[number] for number in poses], [*poses.values()])
    lost = [frame.name for number, frame in enumerate(frames) if number not in poses]
    if len(posed) < thresholds.MIN_IMAGES:
        most = max(len(numbers) for _, numbers in seen)
        raise DigsError(
            f"--poses {BOARD}{path}: {counted(len(posed), 'frame')} of {len(frames)} show the board, "
            f"expected {thresholds.MIN_IMAGES} or more; one shows {counted(most, 'point')} of it. Are "
            "dictionary, rows, columns and lengths those of the print?"
        )
    if lost:
        words = counted(len(lost), "frame"), first_few(lost)
        logger.warning("left out: %s that do not show enough of the board (%s)", *words)
    logger.info("poses: %d of %s by the board", len(posed), counted(len(frames), "frame"))
    return posed


def _pose(frame: Frame, seen: Seen, layout: dict[int, np.ndarray]) -> np.ndarray | None:
    """Return ``world_from_cam`` before the board; None: too little of it is seen, or it does not fit."""
    import cv2

    known = [number in layout for number in seen[1]]
    px, numbers = seen[0][known], seen[1][known]
    if len(px) < 4:
        return None
    points = np.array([layout[number] for number in numbers])
    lens = (frame.camera.intrinsics.matrix, None)
    good, turn, shift = cv2.solvePnP(points, px, *lens, flags=cv2.SOLVEPNP_IPPE)
    if not good:
        return None
    turn, shift = cv2.solvePnPRefineLM(points, px, *lens, turn, shift)
    errors = np.linalg.norm(cv2.projectPoints(points, turn, shift, *lens)[0][:, 0] - px, axis=1)
    if not np.median(errors) < thresholds.MAX_BOARD_ERROR:
        return None
    return invert_rigid(rigid(cv2.Rodrigues(turn)[0], shift[:, 0]))


def read_board(path: Path) -> Board:
    """Return the board that a file describes.

    Raises:
        DigsError: it is missing, or describes no board.
    """
    where = f"board '{path}'"
    file = Fields.of(read_yaml(path, "board"), where)
    if file.text("type", None) == "charuco":
        return _charuco(file, where)
    if file.text("target_type", None) == "aprilgrid":
        return _tags(file, where)
    raise DigsError(f"{where}: expected 'type: charuco', or Kalibr's 'target_type: aprilgrid'")


def _dictionary(file: Fields, where: str, usual: str) -> Any:
    from cv2 import aruco

    name = file.text("dictionary", usual).upper()
    known = [each for each in dir(aruco) if each.startswith("DICT_") and each.isupper()]
    if name not in known:
        raise DigsError(f"{where}: dictionary '{name}'{did_you_mean(name, known)}")
    return aruco.getPredefinedDictionary(getattr(aruco, name))


def _charuco(file: Fields, where: str) -> Board:
    from cv2 import aruco

    columns, rows = (file.whole(name, 2, 100) for name in ("columns", "rows"))
    square, marker = file.number("square"), file.number("marker")
    dictionary = _dictionary(file, where, "DICT_4X4_50")
    if not 0 < marker < square:
        raise DigsError(f"{where}: expected 0 < marker < square")
    boards = [aruco.CharucoBoard((columns, rows), square, marker, dictionary) for _ in range(2)]
    boards[1].setLegacyPattern(True)  # OpenCV before 4.6 began even rows with the other color
    detectors = [aruco.CharucoDetector(board) for board in boards]

    def find(gray: np.ndarray) -> Seen:
        found = (detector.detectBoard(gray)[:2] for detector in detectors)
        return max((_seen(px, ids) for px, ids in found), key=lambda seen: len(seen[1]))

    corners = np.asarray(boards[0].getChessboardCorners(), np.float64)
    upward = corners * [1, -1, 1] + [0, rows * square, 0]
    return Board(find, (dict(enumerate(upward)),))


def _seen(px: Any, ids: Any) -> Seen:
    """Return OpenCV's points, whose pixel centers are whole, as ours; none where it found none."""
    if ids is None or px is None:
        return np.zeros((0, 2)), np.zeros(0, np.intp)
    return np.asarray(px, np.float64).reshape(-1, 2) + 0.5, np.asarray(ids, np.intp).reshape(-1)


def _tags(file: Fields, where: str) -> Board:
    from cv2 import aruco

    columns, rows = (file.whole(name, 1, 100) for name in ("tagCols", "tagRows"))
    tag, spacing = file.number("tagSize"), file.number("tagSpacing")
    if not (tag > 0 and spacing >= 0):
        raise DigsError(f"{where}: expected a tagSize above 0 m and a tagSpacing of 0 or more")
    dictionary = _dictionary(file, where, "DICT_APRILTAG_36H11")
    detectors = []
    for border in (1, 2):  # Kalibr prints a border of two bits
        options = aruco.DetectorParameters()
        options.markerBorderBits = border
        options.cornerRefinementMethod = aruco.CORNER_REFINE_SUBPIX
        detectors.append(aruco.ArucoDetector(dictionary, options))

    def find(gray: np.ndarray) -> Seen:
        found = (detector.detectMarkers(gray)[:2] for detector in detectors)
        px, ids = max(found, key=lambda each: 0 if each[1] is None else len(each[1]))
        numbers = None if ids is None else np.reshape(ids, (-1, 1)) * 4 + np.arange(4)
        return _seen(px if ids is not None else None, numbers)

    step = tag * (1 + spacing)
    corners = tag * np.array([(0, 1, 0), (1, 1, 0), (1, 0, 0), (0, 0, 0)], np.float64)

    def layout(upward: bool, turned: int) -> dict[int, np.ndarray]:
        return {
            4 * (row * columns + column) + (corner + turned) % 4: at + corners[corner]
            for row, column, corner in product(range(rows), range(columns), range(4))
            for at in [np.array([column, row if upward else rows - 1 - row, 0]) * step]
        }

    return Board(find, tuple(layout(up, turned) for up in (False, True) for turned in range(4)))
