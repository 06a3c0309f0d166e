"""The causes of missing depth are told without color: by the pattern in which a picture is darker."""

import numpy as np

from digs_warp.show.report.causes import OK_COLOR, PATTERNS, TILE, paint_causes
from digs_warp.show.report.pictures import shrink


def darker_places(code: int, step: int = 1) -> np.ndarray:
    """Where the picture of one cause is darker than its brightest place."""
    picture = shrink(paint_causes(np.full((4 * TILE * step,) * 2, code, np.uint8), step), 4 * TILE)
    gray = picture.astype(int).sum(axis=2)
    return gray < gray.max()


def test_neighboring_causes_differ_in_their_patterns_and_right_depth_has_none() -> None:
    patterns = [darker_places(code) for code in range(1, len(PATTERNS) + 1)]
    for number, one in enumerate(patterns):
        for other in patterns[:number]:
            assert (one != other).mean() > 0.1
    assert (paint_causes(np.zeros((5, 7), np.uint8)) == OK_COLOR).all()


def test_a_pattern_stays_when_the_picture_is_reduced() -> None:
    for code in range(1, len(PATTERNS) + 1):
        np.testing.assert_array_equal(darker_places(code, step=3), darker_places(code))
