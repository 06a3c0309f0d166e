"""Which frames are compared: most pairs are left out without a look at all of their points."""

import numpy as np
import pytest

from digs_warp.poses import covisibility
from digs_warp.poses.covisibility import overlapping_pairs
from reference.textured_plane import picture, ring_of_poses

COUNT, SCREENED = 24, 16


def test_pairs_left_out_early_change_nothing_and_save_most_of_the_work(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    poses = ring_of_poses(COUNT)
    pictures = [picture(pose).at_most(40) for pose in poses]
    looked_at: list[int] = []
    seen = covisibility._seen

    def counted(*given) -> np.ndarray:
        looked_at.append(1)
        return seen(*given)

    monkeypatch.setattr(covisibility, "_seen", counted)
    monkeypatch.setattr(covisibility, "SCREENED", SCREENED)
    found = overlapping_pairs(pictures, poses)
    assert len(looked_at) == COUNT * SCREENED
    monkeypatch.setattr(covisibility, "SCREENED", COUNT)
    np.testing.assert_array_equal(found, overlapping_pairs(pictures, poses))
    assert len(looked_at) == COUNT * SCREENED + COUNT * (COUNT - 1)
