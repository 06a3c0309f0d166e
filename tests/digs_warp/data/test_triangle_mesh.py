"""The colored mesh that surface extraction hands on."""

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.triangle_mesh import TriangleMesh

CORNERS = np.eye(3)
GREY = np.full((3, 3), 0.5)


def test_arrays_that_do_not_fit_are_refused() -> None:
    assert len(TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)))) == 0
    arrays = vars(TriangleMesh(CORNERS, np.array([[0, 1, 2]]), GREY)).values()
    assert [array.dtype for array in arrays] == ["float32", "int32", "float32"]
    for points, triangles, colors, message in (
        (CORNERS, [[0, 1, 3]], GREY, "0 to 3, expected 0 to 2"),
        (CORNERS, [[-1, 1, 2]], GREY, "-1 to 2"),
        (CORNERS, [[0, 1]], GREY, r"shape \(1, 2\)"),
        (CORNERS, [[0, 1, 2]], GREY[:2], r"expected \(3, 3\)"),
        (CORNERS * np.nan, [[0, 1, 2]], GREY, "NaN"),
    ):
        with pytest.raises(DigsError, match=message):
            TriangleMesh(points, np.array(triangles), colors)
