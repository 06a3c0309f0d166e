"""All initializations from depth at rising sensor noise: they get worse no faster than the noise."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from digs_warp.data.capture import Capture
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initialize
from digs_warp.init.strategies import StrategyName
from digs_warp.sim.testing.series import NoiseSeries
from reference.synthetic_sfm import sfm_from_truth

STRATEGIES: tuple[StrategyName, ...] = ("highdepth", "fusion")


def true_surface(capture: Capture) -> np.ndarray:
    """Points of all views' true depth on the object."""
    points = []
    for frame in capture.frames:
        depth = frame.load_depth_true()
        rows, columns = np.nonzero((frame.load_mask() == 255) & (depth < 1.5))
        px = np.stack([columns + 0.5, rows + 0.5], axis=-1)
        points.append(frame.camera.unproject(px, depth[rows, columns].astype(np.float64)))
    return np.concatenate(points)


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.sensor_noise(frames=4, width=280, height=158)
def test_points_stay_near_the_surface(sensor_noise: NoiseSeries, strategy: StrategyName) -> None:
    surface = KDTree(true_surface(sensor_noise.capture(0.0)))
    sfm = sfm_from_truth(sensor_noise.capture(0.0).frames, 1.0, points=1500)

    def median_distance(capture: Capture) -> float:
        """In metres; the nearest true pixel is up to a pixel's width (4 mm) away."""
        # The limits are for these voxels, finer than the default for images as small as these.
        config = InitConfig(strategy=strategy, voxel_size=0.01 if strategy == "depth" else 0.004)
        points = initialize(capture.frames, config, sfm).points.points_world
        assert len(points) > 300
        return float(np.median(surface.query(points)[0]))

    curve = sensor_noise.measure(median_distance)
    curve.assert_at_most({0: 0.002, 1: 0.005, 2: 0.008, 4: 0.016})
    curve.assert_no_cliff(largest_growth=1.5)
