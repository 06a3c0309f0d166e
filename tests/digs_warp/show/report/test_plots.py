"""Charts: well-formed, with all labels, and everything drawn lies within the picture."""

import re
from xml.etree import ElementTree

import pytest

from digs_warp.show.report.plots import Line, line_chart

CHARTS = {
    "lines": ([Line("a & b", [0, 300], [17.5, 26.0], True), Line("c", [5], [20])], "n", "y"),
    "one value": ([Line("same", [1, 2], [0.0, 0.0])], "n", "z"),
}
TEXTS = {"lines": "a & b|c|0|100|300|18|26|n|y", "one value": "-0.4|0.4|1|2|n|z"}


@pytest.mark.parametrize("name", CHARTS)
def test_all_of_a_chart_lies_within_it(name: str) -> None:
    root = ElementTree.fromstring(line_chart(*CHARTS[name]))
    width, height = (float(number) for number in root.attrib["viewBox"].split()[2:])
    for element in root:
        for key, most in (("x", width), ("cx", width), ("y", height), ("cy", height)):
            assert 0 <= float(element.get(key, 0)) <= most
        for right, down in re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", element.get("d", "")):
            assert 0 <= float(right) <= width and 0 <= float(down) <= height
    texts = {text.text for text in root.iter() if text.text}
    assert {*TEXTS[name].split("|")} <= texts, texts
