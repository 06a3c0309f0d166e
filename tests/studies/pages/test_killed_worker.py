"""The trial with a killed worker: the recordings that it reconstructs."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import read_capture
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate

pytest.importorskip("psutil", reason="psutil is not installed: extra cluster")


def test_a_walk_is_cut_into_captures_from_all_along_it(tmp_path: Path) -> None:
    from studies.pages.killed import cut

    small = SimulateConfig(frames=6, width=48, samples_per_pixel=1, tier="law")
    walk = simulate(small, tmp_path / "walk")
    captures = [read_capture(each) for each in cut(tmp_path / "walk", tmp_path / "cut", 2)]
    names = [[frame.name for frame in capture.frames] for capture in captures]
    assert names == [["0000", "0002", "0004"], ["0001", "0003", "0005"]]
    np.testing.assert_array_equal(captures[1].frames[2].load_depth(), walk.frames[5].load_depth())
