"""The depth of the surface: the mean over the splats of one surface, never one between two surfaces."""

import numpy as np

from digs_warp.splat.surface_depth import surface_depth


def test_the_median_counts_between_two_surfaces_and_nothing_without_one() -> None:
    channels = np.array([[0.0, 0.0], [1.0, 0.0], [1.001, 1.0], [1.2, 1.0]], np.float32)
    np.testing.assert_array_equal(
        surface_depth(channels), np.array([np.nan, np.nan, 1.001, 1.0], np.float32)
    )
