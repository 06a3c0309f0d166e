"""Charts: well-formed, with all labels, and everything drawn lies within the picture."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from digs_warp.show.report.plots import Bar, Line, bar_chart, line_chart, map_chart

TURN = np.linspace(0, 2 * np.pi, 40)
CIRCLE = np.stack([np.cos(TURN), np.sin(TURN)], axis=1)
CHARTS = {
    "lines": line_chart(
        [Line("a & b", [0, 300], [17.5, 26.0], True), Line("c", [5], [20])], "n", "y"
    ),
    "one value": line_chart([Line("same", [1, 2], [0.0, 0.0])], "n", "y"),
    "logarithmic": line_chart([Line("loss", [1, 9], [0.3, 0.0041])], "n", "loss", log_y=True),
    "less than a factor of two": line_chart([Line("loss", [1, 9], [3, 3.1])], "n", "y", log_y=True),
    "bars": bar_chart([Bar("train <", 31.2, "a"), Bar("export", 0.0, "b")], "seconds"),
    "map": map_chart(3 * CIRCLE, -CIRCLE, TURN > 5, (np.array([0.5, 0]), 4.0), "m"),
}


@pytest.mark.parametrize("name", CHARTS)
def test_all_of_a_chart_lies_within_it(name: str) -> None:
    root = ElementTree.fromstring(CHARTS[name])
    width, height = (float(number) for number in root.attrib["viewBox"].split()[2:])
    for element in root:
        for key, most in (("x", width), ("cx", width), ("y", height), ("cy", height)):
            assert 0 <= float(element.get(key, 0)) <= most
        for right, down in re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", element.get("d", "")):
            assert 0 <= float(right) <= width and 0 <= float(down) <= height


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("lines", ["a & b", "c", "0", "100", "300", "18", "26", "n", "y"]),
        ("logarithmic", ["0.005", "0.01", "0.02", "0.2", "loss"]),
        ("less than a factor of two", ["3", "3.1"]),
        ("bars", ["train <", "31.2", "0.0", "seconds"]),
        ("map", ["training", "held out", "m", "-4", "4"]),
    ],
)
def test_axes_and_legend_say_what_is_shown(name: str, expected: list[str]) -> None:
    texts = [text.text for text in ElementTree.fromstring(CHARTS[name]).iter() if text.text]
    assert set(expected) <= set(texts), texts
