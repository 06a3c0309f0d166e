"""A training run in a folder: steps, course, checkpoints, and the Gaussians at the end."""

import time
from pathlib import Path

from digs_warp.capture import Frame
from digs_warp.gaussians import Gaussians
from digs_warp.log import RunLog, progress
from digs_warp.train.checkpoint import load_checkpoint, save_checkpoint
from digs_warp.train.config import TrainConfig
from digs_warp.train.course import LOG_EVERY, Course
from digs_warp.train.evaluate import TestView
from digs_warp.train.trainer import Trainer
from digs_warp.train.views import load_views

# What a run leaves in its folder (docs/reconstruction-format.md).
GAUSSIANS = "gaussians.npz"
CHECKPOINT = "checkpoint.npz"
TRAINING = "training.jsonl"

# A finished scene keeps Gaussians from this opacity on: less changes no pixel by more than 3 of 255.
MIN_OPACITY = 0.01

# Seconds of training between two checkpoints: what an interruption costs at most.
CHECKPOINT_SECONDS = 30.0


def train_gaussians(
    seeds: Gaussians,
    frames: list[Frame],
    test_views: list[TestView],
    config: TrainConfig,
    folder: Path,
    log: RunLog,
    resume: bool = False,
) -> Gaussians:
    """Train ``seeds`` on ``frames`` and leave Gaussians and the course of the run in ``folder``.

    Args:
        seeds: the start.
        frames: the views to train on.
        test_views: held-out views that are measured along the way; they never serve the training.
        config: settings.
        folder: where gaussians.npz, training.jsonl and checkpoint.npz go; exists.
        log: gets the times of the stages and the results.
        resume: go on from the folder's checkpoint where there is one, bit for bit.

    Raises:
        DigsError: bad views, a broken checkpoint, or a training that diverged.
        KeyboardInterrupt: passed on after a checkpoint is saved.
    """
    with log.stage("load views"):
        views = load_views(frames, config.device)
    with log.stage("prepare kernels"):
        trainer = Trainer(seeds, views, config)
    if resume and (folder / CHECKPOINT).is_file():
        load_checkpoint(folder / CHECKPOINT, trainer)
    course = Course(folder / TRAINING, trainer, test_views)
    try:
        with log.stage("train"):
            _run_steps(trainer, course, folder)
    except KeyboardInterrupt:
        save_checkpoint(folder / CHECKPOINT, trainer)
        raise
    finally:
        log.seconds["train"] -= course.seconds
        log.seconds["measure course"] = log.seconds.get("measure course", 0.0) + course.seconds
    gaussians = _without_transparent(trainer.gaussians.to_numpy())
    gaussians.save(folder / GAUSSIANS)
    (folder / CHECKPOINT).unlink(missing_ok=True)
    log.results |= {"gaussians": len(gaussians), "iterations": config.iterations}
    log.results["training_seconds"] = round(trainer.seconds, 3)
    return gaussians


def _run_steps(trainer: Trainer, course: Course, folder: Path) -> None:
    total = trainer.config.iterations
    saved = time.monotonic()
    with progress(total, "Training", initial=trainer.optimizer.step) as bar:
        if trainer.optimizer.step == 0:
            course.record(measure=True)
        while trainer.optimizer.step < total:
            trainer.step()
            step = trainer.optimizer.step
            measure = step == total or step in trainer.config.evaluate_at
            if measure or step % LOG_EVERY == 0:
                bar.set_postfix_str(course.record(measure), refresh=False)
            if time.monotonic() - saved > CHECKPOINT_SECONDS:
                save_checkpoint(folder / CHECKPOINT, trainer)
                saved = time.monotonic()
            bar.update()


def _without_transparent(gaussians: Gaussians) -> Gaussians:
    """Leave out what the training faded to nothing; strays far from the object would inflate its box."""
    keep = gaussians.opacities >= MIN_OPACITY
    return gaussians.select(keep) if keep.any() else gaussians
