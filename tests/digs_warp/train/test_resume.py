"""N steps, a checkpoint, and N more are the same bits as 2 N steps, for every density control."""

from dataclasses import replace
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.record.arrays import write_arrays
from digs_warp.train import density as density_module
from digs_warp.train.checkpoint import checkpoint_step, load_checkpoint, save_checkpoint
from digs_warp.train.config import Density, DensityStrategy, Stop, TrainConfig
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views
from reference.tiny_capture import ball
from reference.trained_ball import assert_same_bits, trained

# Refined every 6 steps from the 4th on, reset at the 18th: what takes thousands of steps otherwise.
STEPS = 40


FRAMES = 6


@pytest.fixture(autouse=True)
def short_schedule(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(density_module, "REFINE_EVERY", 6)
    monkeypatch.setattr(density_module, "RESET_EVERY", 18)
    monkeypatch.setattr(density_module, "GRADIENT_LIMIT", 1e-5)


def start() -> Gaussians:
    truth = ball(300)
    logits = truth.opacity_logits.copy()
    logits[:40] = -7.0  # pruned
    return replace(truth, sh=np.zeros_like(truth.sh), opacity_logits=logits)


@pytest.mark.parametrize("density", ["fixed", "adaptive"])
def test_a_resumed_run_continues_bit_for_bit(
    capture: Capture, tmp_path: Path, density: DensityStrategy
) -> None:
    config = TrainConfig(
        stop=Stop(iterations=STEPS), density=Density(strategy=density, max_splats=900)
    )
    whole = trained(capture.frames, config, start(), STEPS)
    half = trained(capture.frames, config, start(), 15)
    path = tmp_path / "checkpoint.npz"
    assert save_checkpoint(path, half)
    assert checkpoint_step(path) == 15
    resumed = Trainer(start(), open_views(capture.frames, config, first_step=15), config)
    load_checkpoint(path, resumed)
    assert resumed.seconds == half.seconds > 0
    assert (half.control is None) == (density == "fixed")
    if half.control is not None and resumed.control is not None:
        for name, values in resumed.control.state().items():
            assert values.any()
            np.testing.assert_array_equal(values, half.control.state()[name])
    for _ in range(STEPS - 15):
        resumed.step()
    for arrays in ("gaussians", "optimizer.moments_1", "optimizer.moments_2"):
        one, other = (attrgetter(arrays)(trainer).to_numpy() for trainer in (whole, resumed))
        assert_same_bits(one, other)
    assert whole.exposures is not None and resumed.exposures is not None
    assert whole.exposures.fitted.all()
    np.testing.assert_array_equal(whole.exposures.log_factors, resumed.exposures.log_factors)
    assert len(whole.gaussians) != 300  # refined, or merged
    assert len(whole.gaussians) <= 900


def test_a_start_beyond_the_cap_is_refused(capture: Capture) -> None:
    config = TrainConfig(density=Density(strategy="adaptive", max_splats=200))
    with pytest.raises(DigsError, match=r"starts with 300 Gaussians.*voxel-size"):
        trained(capture.frames, config, start(), 0)


def test_a_state_that_is_not_finite_does_not_replace_a_good_one(
    capture: Capture, tmp_path: Path
) -> None:
    trainer = trained(capture.frames, TrainConfig(stop=Stop(iterations=5)), start(), 2)
    path = tmp_path / "checkpoint.npz"
    assert save_checkpoint(path, trainer)
    good = path.read_bytes()
    values = trainer.gaussians.quats.numpy()
    values[3, 1] = np.inf
    trainer.gaussians.quats.assign(values)
    assert not save_checkpoint(path, trainer)
    assert path.read_bytes() == good


def test_a_checkpoint_of_other_settings_is_refused(capture: Capture, tmp_path: Path) -> None:
    config = TrainConfig(stop=Stop(iterations=5))
    path = tmp_path / "checkpoint.npz"
    save_checkpoint(path, trained(capture.frames, config, start(), 1))
    other = replace(config, density=Density(strategy="adaptive"))
    with pytest.raises(DigsError, match="density control differ"):
        load_checkpoint(path, trained(capture.frames, other, start(), 0))
    seeds = replace(start(), sh=np.zeros((300, 4, 3)))
    trainer = Trainer(seeds, open_views(capture.frames, config), config)
    with pytest.raises(DigsError, match="color coefficients differ"):
        load_checkpoint(path, trainer)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("step", np.array([1, 2])),
        ("identity", np.array("[" * 100_000)),
        ("first_means", np.zeros((7, 3))),
        ("second_sh", np.full((300, 1, 3), np.inf)),
        ("control_sums", np.zeros(3)),
        ("value_quats", None),
        ("exposure_log_factors", np.zeros((3, 3))),
    ],
)
def test_a_checkpoint_of_another_shape_is_refused(
    capture: Capture, tmp_path: Path, name: str, value: np.ndarray | None
) -> None:
    config = TrainConfig(stop=Stop(iterations=5), density=Density(strategy="adaptive"))
    path = tmp_path / "checkpoint.npz"
    save_checkpoint(path, trained(capture.frames, config, start(), 1))
    with np.load(path) as saved:
        state = {key: saved[key] for key in saved.files if key != name or value is not None}
    write_arrays(path, state | ({} if value is None else {name: value}))
    trainer = trained(capture.frames, config, start(), 0)
    with pytest.raises(DigsError, match=r"checkpoint '.*checkpoint\.npz'"):
        load_checkpoint(path, trainer)
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(DigsError, match=r"checkpoint\.npz.*delete it"):
        load_checkpoint(path, trainer)
