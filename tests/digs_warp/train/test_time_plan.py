"""A time budget: the steps that are planned, and the progress along which schedules run."""

import shutil
from pathlib import Path

import pytest

from digs_warp.data.capture import Capture
from digs_warp.init.config import InitConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.train import session
from digs_warp.train.config import Stop, TrainConfig
from digs_warp.train.session import plan_training
from digs_warp.train.trainer import Resolved, Trainer
from reference.tiny_capture import ball
from reference.trained_ball import interrupt


@pytest.mark.parametrize("pace", [0.5, 3.0])
def test_steps_of_any_pace_end_with_the_time_and_the_progress(
    pace: float, capture: Capture
) -> None:
    config = TrainConfig(stop=Stop(iterations=100, time_budget=10.0))
    views = session.open_data(capture.frames, config, capture.folder).views
    trainer = Trainer(ball(10), views, config, Resolved(most_steps=500))
    while not trainer.ended_by:
        trainer.optimizer.step += 1
        trainer.seconds += 0.1 * pace * (1.5 if trainer.seconds > 5 else 1.0)
    assert trainer.seconds == pytest.approx(10.0, rel=0.05) and trainer.ended_by == "time budget"
    assert trainer.progress == 1.0
    trainer.most_steps = trainer.optimizer.step  # the steps end before the time
    assert trainer.ended_by == "iterations"


CONFIG = ReconstructConfig(
    init=InitConfig(voxel_size=0.02),
    train=TrainConfig(stop=Stop(iterations=40, time_budget=100.0), sh_degree=0),
)


FRAMES = 9


def test_the_plan_is_recorded_and_kept_by_a_resumed_run(
    capture: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "PLANNING_SHARE", 0.0)
    interrupt(lambda: reconstruct(capture, CONFIG, tmp_path / "out"), 17, monkeypatch)
    before = Path(shutil.copytree(tmp_path / "out", tmp_path / "before"))

    def refused(*_: object) -> None:
        raise AssertionError("planned again")

    monkeypatch.setattr("digs_warp.pipeline.optimize.plan_training", refused)
    result = reconstruct(capture, CONFIG, tmp_path / "out", resume=True)
    plan = result.training.plan
    assert plan is not None and plan.iterations == result.training.iterations == 40
    assert result.training.stopped_by == "iterations"
    assert Reconstruction.load(tmp_path / "out").training.plan == plan
    assert str(plan.step_seconds) in (before / "run.json").read_text()


def test_planning_times_steps_of_a_copy(capture: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    step = Trainer.step

    def slow_step(trainer: Trainer) -> None:
        before = trainer.seconds
        step(trainer)
        trainer.seconds = before + 0.1

    monkeypatch.setattr(Trainer, "step", slow_step)
    config = TrainConfig(stop=Stop(iterations=400, time_budget=10.05))
    data = session.open_data(capture.frames, config, capture.folder)
    plan = plan_training(ball(300), data, config)
    assert plan.step_seconds == pytest.approx(0.1) and plan.iterations == 100
    assert plan.budget == 10.05
