"""The chart of a training: well-formed, with all labels, and everything drawn lies within the picture."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from digs_warp.show.report.course_section import line_chart


@pytest.mark.parametrize(
    ("points", "texts", "ends"),
    [
        ([(0, 17.5), (300, 26)], {"0", "50", "300", "16", "26"}, [(62, 243.2), (504, 12)]),
        (
            [(100, -0.02), (900, 0.13)],
            {"0", "1,000", "-0.05", "0.15"},
            [(106.2, 243.2), (459.8, 39.2)],
        ),
    ],
)
def test_all_of_a_chart_lies_within_it(points, texts, ends) -> None:
    root = ElementTree.fromstring(line_chart(np.array(points)))
    width, height = (float(number) for number in root.attrib["viewBox"].split()[2:])
    for element in root:
        for key, most in (("x", width), ("y", height)):
            assert 0 <= float(element.get(key, 0)) <= most
    assert texts | {"iterations", "PSNR [dB]"} <= {each.text for each in root.iter() if each.text}
    line = re.findall(r"(-?[\d.]+) (-?[\d.]+)", root[1].attrib["d"])
    np.testing.assert_allclose(np.array(line, float), ends, atol=0.5)
