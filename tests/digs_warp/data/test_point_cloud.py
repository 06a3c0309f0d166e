"""Points of files: colors of any kind of number, and positions that are no numbers."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.point_cloud import read_points


def test_colors_of_any_kind_are_shares_of_one(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for kind, top, half in (
        *(("uchar", 255, 128), ("ushort", 65535, 32768)),
        *(("float", 1, 0.5), ("float", 255, 128)),
    ):
        colors = "".join(f"property {kind} {name}\n" for name in ("red", "green", "blue"))
        places = "".join(f"property float {axis}\n" for axis in "xyz")
        rows = f"1 2 3 {top} 0 {half}\nnan 0 0 0 0 0\n"
        header = f"ply\nformat ascii 1.0\nelement vertex 2\n{places}{colors}end_header\n"
        (tmp_path / "a.ply").write_text(header + rows)
        cloud = read_points(tmp_path / "a.ply", offset=np.ones(3), scale=0.5)
        np.testing.assert_array_equal(cloud.points_world, [[1, 3, 5]])
        np.testing.assert_allclose(cloud.colors, [[1, 0, 0.5]], atol=0.002)
    assert "1 of 2 are not finite and are left out" in caplog.text
