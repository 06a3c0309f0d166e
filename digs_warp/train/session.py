"""A training run in a folder: steps, course, checkpoints, and the Gaussians at the end."""

import logging
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from digs_warp.checks import check_finite, check_shape
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.measure.scores import mean_score
from digs_warp.poses.in_training import TrainedPoses
from digs_warp.record.arrays import open_arrays, write_arrays
from digs_warp.record.files import remove
from digs_warp.record.interruption import deferred_interrupt
from digs_warp.record.layout import CHECKPOINT, GAUSSIANS, TRAINED_POSES, TRAINING
from digs_warp.record.progress import progress
from digs_warp.record.run_log import RunLog
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.adherence import MeasuredView, adherence, load_measured_views
from digs_warp.train.checkpoint import checkpoint_step, load_checkpoint, save_checkpoint
from digs_warp.train.config import TrainConfig
from digs_warp.train.evaluate import MeasuredViews, TestView, TestViews, measure_views, moved_views
from digs_warp.train.objective import OwnLoss
from digs_warp.train.shutter import NO_SHUTTER, Shutter
from digs_warp.train.trainer import Resolved, Trainer
from digs_warp.train.training import (
    CourseRow,
    TimePlan,
    Training,
    drop_snapshots_after,
    read_course,
    save_snapshot,
    write_course,
)
from digs_warp.train.view_store import ViewStore, open_views

logger = logging.getLogger(__name__)

# A finished scene keeps Gaussians from this opacity on: a lower one changes a pixel by at most 3 of 255.
MIN_OPACITY = 0.01

# Iterations between two lines of the course.
LOG_EVERY = 10

# Seconds of training between two checkpoints: the most that an interruption can cost.
CHECKPOINT_SECONDS = 30.0

# To plan for a time budget, at least so many steps are taken, and this share of the budget.
PLANNING_STEPS, PLANNING_SHARE = 3, 0.02


# Called every few iterations with their number and the Gaussians, which it must not change or keep.
Watch: TypeAlias = Callable[[int, DeviceGaussians], None]


@dataclass(frozen=True)
class Hooks:
    """What a caller adds to a training: who looks on, and a further term."""

    watch: Watch | None = None
    loss: OwnLoss | None = None


NO_HOOKS = Hooks()


@dataclass(frozen=True, eq=False)
class Trained:
    """The result of a training run."""

    gaussians: Gaussians
    record: Training
    # Of the training frames, then of the held-out ones, (n, 4, 4); None if they were not trained.
    poses: np.ndarray | None = None
    # The held-out views as the result shows them; None where nobody measured just that.
    measured: MeasuredViews | None = None


@dataclass(frozen=True, eq=False)
class TrainingData:
    """What a training reads of the frames; `train_gaussians` closes it."""

    views: ViewStore  # to train on
    measured: Sequence[MeasuredView]  # whose measured depth the surface is compared with
    first_step: int = 0  # that the training starts or goes on at
    resolved: Resolved = field(default_factory=Resolved)  # what else was found out


def open_data(
    frames: Sequence[Frame],
    config: TrainConfig,
    folder: Path,
    resume: bool = False,
    shutter: Shutter = NO_SHUTTER,
) -> TrainingData:
    """Read what a training in ``folder`` needs; arguments as of `train_gaussians`.

    Args:
        frames: the views to train on.
        config: settings.
        folder: of the training.
        resume: continue from the folder's checkpoint if it has one.
        shutter: how the cameras move while their rows are read.

    Raises:
        DigsError: bad views, or a broken checkpoint.
    """
    first_step = checkpoint_step(folder / CHECKPOINT) if resume else 0
    views = open_views(frames, config, first_step, shutter)
    return TrainingData(views, load_measured_views(frames, shutter), first_step)


def train_gaussians(
    seeds: Gaussians,
    data: TrainingData,
    test_views: TestViews,
    config: TrainConfig,
    folder: Path,
    log: RunLog,
    watch: Watch | None = None,
    plan: TimePlan | None = None,
) -> Trained:
    """Train ``seeds`` on ``data``; also save the Gaussians and the training progress to ``folder``.

    A training that was interrupted there continues from its checkpoint, bit for bit, if `open_data` found it.

    Args:
        seeds: the Gaussians to start from.
        data: of the frames to train on.
        test_views: held-out views that are measured along the way; they are never trained on.
        config: settings.
        folder: where gaussians.npz, training.jsonl and checkpoint.npz go; must exist.
        log: receives the times of the stages.
        watch: looks on.
        plan: for the time budget, which is recorded; ``config`` has its iterations.

    Raises:
        DigsError: a broken checkpoint, or a training that diverged.
        KeyboardInterrupt: after Ctrl-C, or a signal that a command handles in the same way, once the current
            step is finished and a checkpoint is saved.
    """
    checkpoint = folder / CHECKPOINT
    try:
        with log.stage("prepare kernels"):
            trainer = Trainer(seeds, data.views, config, data.resolved)
        if data.first_step:
            load_checkpoint(checkpoint, trainer)
        course = CourseRecorder(folder / TRAINING, trainer, test_views, data.measured)
        try:
            with log.stage("train"):
                stopped = _run_steps(trainer, course, checkpoint, watch)
        finally:
            log.seconds["train"] -= course.seconds
            log.seconds["measure course"] = log.seconds.get("measure course", 0.0) + course.seconds
    finally:
        data.views.close()
    gaussians = _without_transparent(trainer.gaussians.to_numpy())
    poses = None
    if trainer.poses is not None:
        with log.stage("move held-out cameras"):
            poses = _all_poses(trainer.poses, gaussians, test_views, config.device)
        # Before the Gaussians, which tell a resumed run that all is there.
        write_arrays(folder / TRAINED_POSES, {"world_from_cam": poses})
    gaussians.save(folder / GAUSSIANS)
    remove(checkpoint)
    # The last line measured all Gaussians, with the held-out cameras where they were.
    is_result = poses is None and len(gaussians) == len(trainer.gaussians)
    measured = course.measured if is_result else None
    record = _record(trainer, course, len(gaussians), stopped, plan)
    return Trained(gaussians, record, poses, measured)


class CourseRecorder:
    """Writes loss and quality by iteration and time.

    Args:
        path: the file, one JSON object per line; lines up to the trainer's iteration are kept.
        trainer: the run.
        test_views: held-out views to measure; may be empty.
        measured_views: measured depth to compare the surface with; may be empty.

    Attributes:
        rows: what was recorded so far.
        seconds: time spent in `record` so far, which does not count as training.
        psnr: last PSNR on the object in the held-out views [dB], minus infinity before they are measured.
        measured: the held-out views as the last line found them; None if it did not measure them.
    """

    def __init__(
        self,
        path: Path,
        trainer: Trainer,
        test_views: Sequence[TestView],
        measured_views: Sequence[MeasuredView] = (),
    ) -> None:
        step = trainer.optimizer.step
        # A resumed run keeps the rows up to its checkpoint.
        before = read_course(path) if step and path.is_file() else ()
        self.rows = [row for row in before if row.iteration <= step]
        self.seconds = 0.0
        self.psnr = -math.inf
        self.measured: MeasuredViews | None = None
        self._path = path
        self._trainer = trainer
        self._test_views = test_views
        self._measured_views = measured_views
        drop_snapshots_after(path.parent, step)

    def record(self, measure: bool) -> str:
        """Add a line; return a short text for the progress bar.

        Args:
            measure: also score the held-out views, measure the adherence, and keep the Gaussians if the
                settings say so.
        """
        start = time.perf_counter()
        trainer = self._trainer
        step = trainer.optimizer.step
        if measure and trainer.config.keep_course:
            save_snapshot(self._path.parent, step, trainer.gaussians.to_numpy())
        self.measured, found = None, None
        if measure:
            views = self._test_views
            self.measured = measure_views(trainer.gaussians, views) if views else None
            found = adherence(trainer.gaussians, self._measured_views)
        row = CourseRow(
            iteration=step,
            seconds=round(trainer.seconds, 4),
            loss=trainer.loss_value() if step else None,
            splats=len(trainer.gaussians),
            score=mean_score(self.measured.scores) if self.measured else None,
            adherence=found,
        )
        if row.score:
            self.psnr = row.score.psnr_object
        self.rows.append(row)
        write_course(self._path, self.rows)
        self.seconds += time.perf_counter() - start
        words = [] if row.loss is None else [f"loss {row.loss:.4f}"]
        words += [f"held out {self.psnr:.1f} dB"] if self.psnr > -math.inf else []
        return ", ".join(words)


def _record(
    trainer: Trainer, course: CourseRecorder, gaussians: int, stopped: str, plan: TimePlan | None
) -> Training:
    exposures, rows = trainer.exposures, tuple(course.rows)
    distances = [row.adherence for row in rows if row.adherence is not None]
    return Training(
        course=rows,
        gaussians=gaussians,
        iterations=rows[-1].iteration,
        stopped_by=stopped,
        training_seconds=round(rows[-1].seconds, 3),
        exposure_stops=round(exposures.rms_stops, 4) if exposures is not None else None,
        adherence=distances[-1] if distances else None,
        plan=plan,
    )


def load_trained_poses(folder: Path, count: int) -> np.ndarray | None:
    """Return `Trained.poses` as `train_gaussians` left them; None: they were not trained.

    Raises:
        DigsError: the file is broken, or does not hold ``count`` poses.
    """
    path = folder / TRAINED_POSES
    if not path.is_file():
        return None
    with open_arrays(path, "trained poses", ("world_from_cam",)) as arrays:
        poses = arrays["world_from_cam"]
    return check_finite(f"'{path}'", check_shape(f"'{path}'", poses, (count, 4, 4)))


def _all_poses(
    trained: TrainedPoses, gaussians: Gaussians, test_views: TestViews, device: str
) -> np.ndarray:
    """Return the poses of the training frames, then those of the held-out ones."""
    views = moved_views(DeviceGaussians.from_numpy(gaussians, device), test_views, trained.shifts)
    return np.stack([*trained.poses, *(camera.world_from_cam for camera in views.cameras)])


def _run_steps(
    trainer: Trainer, course: CourseRecorder, checkpoint: Path, watch: Watch | None
) -> str:
    """Take the remaining steps; return what ended the run."""
    saved = time.monotonic()
    with (
        deferred_interrupt() as interruption,
        progress(trainer.config.stop.iterations, "Training", initial=trainer.optimizer.step) as bar,
    ):
        if trainer.optimizer.step == 0:
            bar.set_postfix_str(course.record(measure=True), refresh=False)
        while not (stop := trainer.ended_by):
            trainer.step()
            step = trainer.optimizer.step
            measure = bool(trainer.ended_by) or step in trainer.config.evaluate_at
            if measure or step % LOG_EVERY == 0:
                bar.set_postfix_str(course.record(measure), refresh=False)
                if watch is not None:
                    watch(step, trainer.gaussians)
            if interruption.asked is not None:
                save_checkpoint(checkpoint, trainer)
                interruption.end()
            if time.monotonic() - saved > CHECKPOINT_SECONDS:
                save_checkpoint(checkpoint, trainer)
                saved = time.monotonic()
            bar.update()
    return stop


def plan_training(seeds: Gaussians, data: TrainingData, config: TrainConfig) -> TimePlan:
    """Choose the steps that fit into the time budget by how long a few steps of a copy take.

    Args:
        seeds: the Gaussians to start from.
        data: of the frames to train on.
        config: settings with a time budget; not more than its iterations are planned.
    """
    budget = config.stop.time_budget
    assert budget is not None
    # Cameras stay where they are: their steps take no longer.
    resolved = replace(data.resolved, train_poses="held", most_steps=None)
    copy = Trainer(seeds, data.views, config, resolved)
    copy.step()  # may compile kernels: not timed
    copy.seconds, steps = 0.0, 0
    while steps < PLANNING_STEPS or copy.seconds < PLANNING_SHARE * budget:
        copy.step()
        steps += 1
    step_seconds = copy.seconds / steps
    fit = max(1, int(min(budget / step_seconds, config.stop.iterations)))
    plan = TimePlan(fit, budget, step_seconds)
    logger.info("time budget of %g s: %s", budget, plan)
    return plan


def _without_transparent(gaussians: Gaussians) -> Gaussians:
    """Drop Gaussians that training faded out; strays far from the object would inflate its bounding box."""
    keep = gaussians.opacities >= MIN_OPACITY
    return gaussians.select(keep) if keep.any() else gaussians
