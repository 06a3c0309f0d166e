"""Sizes are told in a unit in which they can be read."""

import pytest

from digs_warp.show.report.capture_facts import sides_words


@pytest.mark.parametrize(
    ("sides", "unit", "words"),
    [
        ((0.002, 0.0012, 0.00052), "m", "2 x 1.2 x 0.52 mm"),
        ((0.0426, 0.0616, 0.0266), "m", "42.6 x 61.6 x 26.6 mm"),
        ((0.187, 0.095, 0.24), "m", "0.187 x 0.095 x 0.240 m"),
        ((0.002, 0.0012, 0.00052), "units", "0.002 x 0.001 x 0.001 units"),
    ],
)
def test_the_sides_of_a_box(sides: tuple[float, ...], unit: str, words: str) -> None:
    assert sides_words(sides, unit) == words
