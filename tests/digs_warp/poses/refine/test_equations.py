"""The equations of many frames: solved without their zeros, the solution is that of all of them."""

import numpy as np
import pytest

from digs_warp.poses.refine import photometric_alignment
from digs_warp.poses.refine.photometric_alignment import PairSums, Scales, solve

LAYOUTS = {"walk": 0, "walk with closures": 40}


def neighbors(frames: int, closures: int) -> np.ndarray:
    """Return pairs of each frame with the four before it, and some of frames far apart, (k, 2)."""
    rng = np.random.default_rng(1)
    pairs = {(i, i - back) for i in range(frames) for back in range(1, 5) if i >= back}
    pairs |= {(int(i), int(j)) for i, j in rng.integers(0, frames, (closures, 2)) if i != j}
    return np.array(sorted(pairs | {(j, i) for i, j in pairs}), np.int32)


def sums_of(pairs: np.ndarray) -> PairSums:
    """Return random equations of the pairs, at poses that are a few centimeters apart."""
    rng = np.random.default_rng(2)
    halves = rng.normal(size=(len(pairs), 6, 6))
    motions = np.tile(np.eye(4), (len(pairs), 1, 1))
    motions[:, :3, 3] = rng.normal(size=(len(pairs), 3)) * 0.1
    sides = rng.normal(size=(len(pairs), 6))
    return PairSums(halves @ halves.transpose(0, 2, 1), sides, motions, Scales(1.0, 1.0))


@pytest.mark.parametrize("closures", LAYOUTS.values(), ids=list(LAYOUTS))
def test_many_frames_move_as_with_all_zeros(closures: int, monkeypatch: pytest.MonkeyPatch) -> None:
    pairs = neighbors(100, closures)
    sums = sums_of(pairs)
    assert 6 * 100 >= photometric_alignment.SPARSE_FROM
    found = solve(sums, pairs, 100)
    assert np.array_equal(found, solve(sums, pairs, 100)), "equal input, equal bits"
    monkeypatch.setattr(photometric_alignment, "SPARSE_FROM", 10**9)
    dense = solve(sums, pairs, 100)
    np.testing.assert_allclose(found, dense, rtol=0, atol=1e-11 * np.abs(dense).max())


@pytest.mark.parametrize("frames", [10, 50])
def test_frames_without_neighbors_stay(frames: int) -> None:
    pairs = neighbors(frames, 0)
    steps = solve(sums_of(pairs), pairs, frames + 5)
    assert np.isfinite(steps).all()
    assert not steps[frames:].any()
