"""Which frames are compared: most pairs are left out without a look at all of their points."""

import numpy as np
import pytest

from digs_warp.poses import agreement
from digs_warp.poses.agreement import overlapping_pairs
from reference.textured_plane import picture, ring_of_poses


def test_pairs_left_out_early_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    poses = ring_of_poses(24)
    pictures = [picture(pose).at_most(40) for pose in poses]
    whole = overlapping_pairs(pictures, poses)
    monkeypatch.setattr(agreement, "SCREENED", 16)
    np.testing.assert_array_equal(overlapping_pairs(pictures, poses), whole)
    assert 0 < len(whole) < 24 * 23
