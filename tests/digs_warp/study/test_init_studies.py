"""The studies of the initialization, small: rows, units, and findings that must not depend on the size."""

import numpy as np
import pytest

from digs_warp.sim.config import SimulateConfig
from digs_warp.study.bench_init import bench_init
from digs_warp.study.bench_init_noise import SFM_PER_METRE, scaled
from digs_warp.study.init_cases import InitCase, render_case
from digs_warp.study.synthetic_sfm import sfm_from_truth


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> InitCase:
    config = SimulateConfig(frames=5, width=320, samples_per_pixel=1)
    return render_case(config, tmp_path_factory.mktemp("case"))


def test_a_case_is_sensed_at_any_strength_and_its_surface_is_the_true_one(case: InitCase) -> None:
    perfect, noisy = case.capture(0.0), case.capture(4.0)
    assert case.capture(4.0) is noisy
    for frame in perfect.frames:
        np.testing.assert_array_equal(frame.load_depth(), frame.load_depth_true())
    assert not np.array_equal(noisy.frames[1].load_depth(), perfect.frames[1].load_depth())
    # Well inside the mask the first ray's depth is the object's.
    frame = perfect.frames[1]
    depth, mask = frame.load_depth(), frame.load_mask()
    rows, columns = np.nonzero((mask == 255) & (depth < 1.5))
    px = np.stack([columns + 0.5, rows + 0.5], axis=-1)
    points = frame.camera.unproject(px, depth[rows, columns].astype(np.float64))
    assert case.score(points).accuracy < 2e-4


def test_the_synthetic_model_projects_onto_its_observations(case: InitCase) -> None:
    frames = case.capture(0.0).frames
    sfm = sfm_from_truth(frames, SFM_PER_METRE, points=500, feature_noise=0.5, mismatches=0.1)
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


def test_scaled_frames_live_in_recovered_metres(case: InitCase) -> None:
    capture = case.capture(0.0)
    sfm = sfm_from_truth(capture.frames, SFM_PER_METRE)
    seen = scaled(capture, sfm, SFM_PER_METRE)
    assert seen.true_per_metre == pytest.approx(1.0, abs=1e-3)
    assert [frame.name for frame in seen.frames] == [f.name for f in capture.frames[1:]]
    np.testing.assert_allclose(
        seen.frames[0].camera.center_world * seen.true_per_metre,
        capture.frames[1].camera.center_world,
        rtol=1e-6,
    )


def test_the_bench_tells_times_memory_and_distances() -> None:
    results = bench_init(width=128, height=72, frames=6, distinct=2)
    (scale,) = (r for r in results if r.table == "scale")
    strategies = [r for r in results if r.table == "strategies"]
    assert sum("wall clock [s]" in r.values for r in strategies) == 3
    assert {r.labels["frames"] for r in results} == {6}
    assert scale.values["scale error"] < 0.03  # of images this small
    assert all(r.values["Chamfer [mm]"] < 25 for r in strategies)
