"""A run in a folder: budgets, Ctrl-C from outside, and a training that diverges."""

import json
import re
import signal
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.cli import main
from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.record.layout import CHECKPOINT, GAUSSIANS, TRAINING
from digs_warp.record.run_log import RunLog
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train import evaluate
from digs_warp.train.config import Stop, TrainConfig
from digs_warp.train.evaluate import load_test_views, measure_views
from digs_warp.train.session import Trained, open_data, train_gaussians
from digs_warp.train.trainer import Trainer
from digs_warp.train.training import load_snapshots, save_snapshot
from reference.interrupted_training import STEP, train_until
from reference.tiny_capture import ball


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
