"""Reconstructions of the tiny capture: how a perfect camera sees them, and how they go on after a signal."""

import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.measure.scores import Score, mean_score
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.config import TrainConfig
from digs_warp.train.evaluate import load_test_views, render_views, score_view
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views
from reference.tiny_capture import ball, write_tiny_capture


def trained(
    frames: Sequence[Frame], config: TrainConfig, start: Gaussians | None = None, steps: int = -1
) -> Trainer:
    """The state after some steps, all of them by default, from a ball."""
    views = open_views(frames, config)
    trainer = Trainer(ball(300) if start is None else start, views, config)
    for _ in range(config.stop.iterations if steps < 0 else steps):
        trainer.step()
    views.close()
    return trainer


def score_of_perfect_views(gaussians: Gaussians, folder: Path) -> Score:
    """Compare with the ball as a camera sees it that does not move; its capture goes to ``folder``."""
    views = load_test_views(write_tiny_capture(folder, 5).frames)
    drawn = render_views(DeviceGaussians.from_numpy(gaussians), views)
    return mean_score([*map(score_view, drawn, views)])


def interrupt(run: Callable[[], object], step: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a training that Ctrl-C ends in the middle of a step."""
    take_step = Trainer.step

    def step_until_interrupted(trainer: Trainer) -> None:
        if trainer.optimizer.step == step:
            signal.raise_signal(signal.SIGINT)
        take_step(trainer)

    with monkeypatch.context() as patched:
        patched.setattr(Trainer, "step", step_until_interrupted)
        with pytest.raises(KeyboardInterrupt):
            run()


def assert_same_bits(one: Gaussians, other: Gaussians) -> None:
    """Check that two results are equal to the bit."""
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


STEP = 40

SCRIPT = """
import os, sys
from digs_warp.cli import main
from digs_warp.train.trainer import Trainer

step, number, usual = int(sys.argv[1]), int(sys.argv[2]), Trainer.step

def step_and_signal(trainer):
    usual(trainer)
    if trainer.optimizer.step == step:
        os.kill(os.getpid(), number)

Trainer.step = step_and_signal
sys.exit(main(sys.argv[3:]))
"""


def train_until(
    number: signal.Signals, arguments: Sequence[str]
) -> subprocess.CompletedProcess[str]:
    """Run a command line in another process, which gets the signal after `STEP` steps."""
    command = [sys.executable, "-c", SCRIPT, str(STEP), str(int(number)), *arguments]
    return subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False)
