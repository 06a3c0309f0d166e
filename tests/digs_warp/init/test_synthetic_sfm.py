"""The model that is made from the truth: its observations, their noise and the share of mismatches."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from reference.synthetic_sfm import sfm_from_truth


def test_the_model_projects_onto_its_observations(tmp_path: Path) -> None:
    config = SimulateConfig(
        profile="bare-matcher", frames=5, width=320, samples_per_pixel=1, tier="truth"
    )
    frames = simulate(config, tmp_path / "capture").frames
    sfm = sfm_from_truth(frames, 1.37, points=500, feature_noise=0.5, mismatches=0.1)
    errors = np.concatenate(
        [
            sfm.cameras[i].project(sfm.points.points_world[sfm.observations.points[rows]])[0]
            - sfm.observations.px[rows]
            for i in range(len(frames))
            for rows in [sfm.observations.cameras == i]
        ]
    )
    wrong = np.linalg.norm(errors, axis=1) > 5
    assert wrong.mean() == pytest.approx(0.1, abs=0.04)
    assert errors[~wrong].std() == pytest.approx(0.5, rel=0.1)
    assert len(sfm.observations) > 1.3 * len(sfm.points)
