"""Real recordings without truth: noise round local planes, and what changes between frames at rest."""

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from digs_warp.study.real_stereo import (
    d435_pair,
    local_noise,
    local_planes,
    recorded_changes,
    still_frames,
)


def test_noise_round_local_planes_is_that_of_the_disparity() -> None:
    rng = np.random.default_rng(0)
    rows, columns = np.indices((160, 224))
    noise = gaussian_filter(rng.standard_normal(rows.shape), 2.0) * np.sqrt(np.pi) * 4 * 0.12
    disparity = 30 + 0.05 * columns - 0.03 * rows + noise
    disparity[:, 128:] += 6 * np.sin(columns[:, 128:] / 3)  # nothing flat there
    disparity[:32, :32] = np.nan
    planes = local_planes(disparity)
    assert np.isnan(planes[:, 128:]).all() and np.isnan(planes[:32, :32]).all()
    found = local_noise(disparity, np.isfinite(planes))
    assert found.sigma.value == pytest.approx(0.12, rel=0.1)
    assert found.correlation.value == pytest.approx(4.0, rel=0.2)


def test_the_d435s_pair_is_searched_near_the_truth_as_over_the_full_range(
    sample_data: Path,
) -> None:
    noise, found = d435_pair(sample_data / "rgbd" / "realsense_d435_ir_pair")
    full, near = found["full search"], found["recorded images"]
    assert near.sigma.value == pytest.approx(full.sigma.value, rel=0.05)
    assert near.correlation.value == pytest.approx(full.correlation.value, rel=0.05)
    assert noise.error < 0.15 * noise.value


def test_the_noise_of_a_camera_at_rest_is_the_published_one(sample_data: Path) -> None:
    """1.2 gray levels between the five still frames (SOURCES.md of the sample data)."""
    frames = still_frames(sample_data / "rgbd" / "euroc_static_stereo")
    assert frames.raw_noise.value == pytest.approx(1.2, abs=0.1)
    assert frames.rig.baseline == pytest.approx(0.110, abs=0.001)
    changes, disparity = recorded_changes(frames)
    assert disparity.shape[0] == 5 and changes.stays > 0.7, "or the rows are not aligned"
