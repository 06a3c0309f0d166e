"""A run in a folder: budgets and plans of time, Ctrl-C from outside, and a training that diverges."""

import json
import re
import shutil
import signal
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.cli import main
from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.init.config import InitConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.layout import CHECKPOINT, GAUSSIANS, TRAINING
from digs_warp.record.run_log import RunLog
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train import evaluate, session
from digs_warp.train.config import Stop, TrainConfig
from digs_warp.train.evaluate import load_test_views, measure_views
from digs_warp.train.session import Trained, open_data, plan_training, train_gaussians
from digs_warp.train.trainer import Resolved, Trainer
from digs_warp.train.training import load_snapshots, save_snapshot
from reference.tiny_capture import ball
from reference.trained_ball import STEP, interrupt, train_until


def run(capture: Capture, folder: Path, config: TrainConfig) -> Trained:
    log = RunLog("test", config)
    test_views = load_test_views(capture.frames[:1])
    data = open_data(capture.frames[1:], config, folder)
    return train_gaussians(ball(300), data, test_views, config, folder, log)


def course(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / TRAINING).read_text().splitlines()]


def test_a_time_budget_ends_the_run_and_measures_it(capture: Capture, tmp_path: Path) -> None:
    config = TrainConfig(stop=Stop(iterations=100_000, time_budget=0.3))
    trained = run(capture, tmp_path, config)
    assert trained.record.stopped_by == "time budget"
    assert 1 <= trained.record.course[-1].iteration < 100_000
    last = course(tmp_path)[-1]
    assert last["iteration"] == trained.record.course[-1].iteration
    assert "psnr_object" in last
    assert last["adherence"] == trained.record.course[-1].adherence
    assert 0 < last["adherence"] < 0.05
    assert len(trained.gaussians) == len(Gaussians.load(tmp_path / GAUSSIANS))
    assert not (tmp_path / CHECKPOINT).exists()


def test_the_course_is_kept_where_views_are_measured(capture: Capture, tmp_path: Path) -> None:
    save_snapshot(tmp_path, 77, ball(3))  # of a run before
    config = TrainConfig(stop=Stop(iterations=4), evaluate_at=(2,), keep_course=True)
    gaussians = run(capture, tmp_path, config).gaussians
    kept = load_snapshots(tmp_path)
    assert [iteration for iteration, _ in kept] == [0, 2, 4]
    np.testing.assert_allclose(kept[0][1].means, ball(300).means, atol=1e-6)
    assert {each.sh_degree for _, each in kept} == {0}
    np.testing.assert_array_equal(kept[-1][1].means, gaussians.means)
    run(capture, tmp_path, TrainConfig(stop=Stop(iterations=2)))
    assert load_snapshots(tmp_path) == ()


OPTIONS = "--iterations 300 --sh-degree 0 --voxel-size 0.02".split()


@pytest.fixture(scope="module")
def undisturbed(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Gaussians:
    folder = tmp_path_factory.mktemp("undisturbed") / "whole"
    assert main(["reconstruct", str(capture.folder), "--out", str(folder), *OPTIONS]) == 0
    return Gaussians.load(folder / GAUSSIANS)


@pytest.mark.usefixtures("hangups_end_a_process")
@pytest.mark.parametrize(
    ("number", "code", "says"),
    [
        (signal.SIGTERM, 143, "interrupted by SIGTERM"),
        pytest.param(signal.SIGINT, 130, "interrupted", marks=pytest.mark.long),
    ],
)
def test_a_signal_saves_and_says_how_to_go_on(
    number: signal.Signals,
    code: int,
    says: str,
    capture: Capture,
    undisturbed: Gaussians,
    tmp_path: Path,
) -> None:
    """A real signal to a real process; the resumed run equals one that was never interrupted."""
    stopped = tmp_path / "stopped"
    again = ["reconstruct", str(capture.folder), "--out", str(stopped), *OPTIONS]
    ended = train_until(number, again)
    assert ended.returncode == code
    assert re.search(
        rf"{says}\. To go on where it stopped: digs-warp reconstruct .*--resume", ended.stderr
    )
    with np.load(stopped / CHECKPOINT) as state:
        assert STEP <= int(state["step"]) < 300
    assert main([*again, "--resume"]) == 0
    resumed = Gaussians.load(stopped / GAUSSIANS)
    for name in FIELDS:
        np.testing.assert_array_equal(
            getattr(undisturbed, name), getattr(resumed, name), err_msg=name
        )


def test_a_diverging_run_leaves_its_last_good_state(
    capture: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from digs_warp.train import session

    step = Trainer.step

    def step_until_spoiled(trainer: Trainer) -> None:
        if trainer.optimizer.step == 12:
            values = trainer.gaussians.means.numpy()
            values[5, 0] = np.nan
            trainer.gaussians.means.assign(values)
        step(trainer)

    monkeypatch.setattr(session, "CHECKPOINT_SECONDS", 0.0)
    monkeypatch.setattr(Trainer, "step", step_until_spoiled)
    with pytest.raises(
        DigsError, match=r"iteration 13, view '\d+'.*means of 1 Gaussian \(the first is 5\)"
    ):
        run(capture, tmp_path, TrainConfig(stop=Stop(iterations=50)))
    with np.load(tmp_path / CHECKPOINT) as state:
        assert int(state["step"]) == 12
        assert np.isfinite(state["value_means"]).all()
    assert not (tmp_path / GAUSSIANS).exists()


def test_held_out_views_beyond_the_memory_are_read_when_they_are_asked_for(
    capture: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = capture.frames
    gaussians = DeviceGaussians.from_numpy(ball())
    kept = load_test_views(frames)
    monkeypatch.setattr(evaluate, "MEMORY", 1)
    views = load_test_views(frames)
    assert len(views._kept) == 1
    moved = views.seen_from([frame.camera for frame in frames[::-1]])
    assert measure_views(gaussians, views).scores == measure_views(gaussians, kept).scores
    assert [view.camera for view in moved] == [view.camera for view in kept[::-1]]
    assert len(moved[1:3]) == 2 and moved[-1].name == frames[-1].name


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
