""".splat: 32 bytes a Gaussian, to the precision that the format has."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import ANTIALIASED
from digs_warp.formats.splats.dot_splat import ROW, read_dot_splat, write_dot_splat
from reference.splat_files import random_gaussians


def test_bytes_of_one_gaussian(tmp_path: Path) -> None:
    """By hand: 1, 2, 3; e^0; dc 0 is gray 128; opacity 1/2; half a turn around x, wxyz."""
    g = random_gaussians(1, 0)
    g.means[:], g.log_scales[:], g.sh[:], g.opacity_logits[:] = (1, 2, 3), 0, 0, 0
    g.quats[:] = (2, 0, 0, 0)
    write_dot_splat(tmp_path / "a.splat", g)
    data = (tmp_path / "a.splat").read_bytes()
    np.testing.assert_array_equal(np.frombuffer(data[:24], "<f4"), [1, 2, 3, 1, 1, 1])
    assert list(data[24:]) == [128, 128, 128, 128, 128, 255, 128, 128]


def test_what_is_lost_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    lossy = replace(random_gaussians(2, 1), screen_filter=ANTIALIASED)
    write_dot_splat(tmp_path / "a.splat", lossy)
    assert "view-dependent" in caplog.text and "antialiasing" in caplog.text


def test_zeros_are_read_and_what_is_no_splat_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.splat"
    row = np.zeros(2, ROW)
    row["quaternion"] = 128
    path.write_bytes(row.tobytes())
    read = read_dot_splat(path)
    assert np.isfinite(read.log_scales).all()
    np.testing.assert_array_equal(read.quats, 0)
    assert read.opacities[0] < 1 / 255
    row["scale"][1] = -1
    for data, message in (
        (bytes(31), "31 bytes, expected a multiple of 32"),
        (b"", "empty"),
        (row.tobytes(), "1 of 2 Gaussians have negative scales"),
    ):
        path.write_bytes(data)
        with pytest.raises(DigsError, match=message):
            read_dot_splat(path)
