"""Capture -> Gaussians: initialization, training and evaluation, each stage cached and resumable.

The folder that `reconstruct` leaves behind is described in docs/reconstruction-format.md.
"""

import json
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.capture import Capture, Frame
from digs_warp.checks import DigsError
from digs_warp.gaussians import Gaussians
from digs_warp.images import to_uint8, write_image
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from digs_warp.init.seed_gaussians import seed_gaussians
from digs_warp.log import RunLog, progress, to_json, write_arrays, write_atomically
from digs_warp.point_cloud import PointCloud
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.checkpoint import load_checkpoint, save_checkpoint
from digs_warp.train.config import TrainConfig
from digs_warp.train.evaluate import (
    TestView,
    load_test_views,
    mean_score,
    render_views,
    score_views,
)
from digs_warp.train.trainer import Trainer
from digs_warp.train.views import load_views

GAUSSIANS = "gaussians.npz"
POINTS = "initial_points.npz"
CHECKPOINT = "checkpoint.npz"
TRAINING = "training.jsonl"
EVALUATION = "evaluation.json"
RENDERS = "renders"
RUN = "run.json"

# A line of training.jsonl every so many iterations.
LOG_EVERY = 10

# A finished scene keeps Gaussians from this opacity on: less changes no pixel by more than 3 of 255.
MIN_OPACITY = 0.01

# Seconds of training between two checkpoints: what an interruption costs at most.
CHECKPOINT_SECONDS = 30.0


@dataclass(frozen=True, kw_only=True)
class ReconstructConfig:
    """How a capture becomes Gaussians."""

    init: InitConfig = field(default_factory=InitConfig)
    train: TrainConfig = field(default_factory=TrainConfig)
    test_every: int = 8
    """Every n-th view, from the first on, is held out for the evaluation."""


def reconstruct(
    capture: Capture, config: ReconstructConfig, folder: Path, resume: bool = False
) -> Gaussians:
    """Reconstruct a capture and leave Gaussians, metrics, renders and run.json in ``folder``.

    Args:
        capture: the recording; held-out views serve neither the initialization nor the training.
        config: settings; with ``resume`` they must be those of the interrupted run.
        folder: where results go; created when missing.
        resume: keep finished stages, and go on from the last checkpoint, bit for bit.

    Raises:
        DigsError: too few frames, nothing to initialize from, or settings that differ on resume.
    """
    folder = Path(folder)
    log = RunLog("reconstruct", config)
    if resume:
        log.continue_from(folder / RUN)
    train_frames, test_frames = capture.split(config.test_every)
    if not train_frames:
        raise DigsError(
            f"capture '{capture.folder}': {len(capture)} frame, expected at least 2: "
            "one is held out for the evaluation"
        )
    log.save(folder / RUN)
    with log.stage("initialize"):
        points = _initialize(train_frames, config, folder, resume)
    log.results["initial_points"] = len(points)
    log.save(folder / RUN)
    with log.stage("load views"):
        test_views = load_test_views(test_frames)
    gaussians = _train(train_frames, test_views, points, config, folder, resume, log)
    with log.stage("evaluate"):
        _write_evaluation(gaussians, test_views, config.train.device, folder, log)
    log.save(folder / RUN)
    return gaussians


def _initialize(
    frames: list[Frame], config: ReconstructConfig, folder: Path, resume: bool
) -> PointCloud:
    path = folder / POINTS
    if resume and path.is_file():
        with np.load(path) as arrays:
            return PointCloud(arrays["points_world"], arrays["colors"])
    points = initial_points(frames, config.init)
    write_arrays(path, {"points_world": points.points_world, "colors": points.colors})
    return points


def _train(
    frames: list[Frame],
    test_views: list[TestView],
    points: PointCloud,
    config: ReconstructConfig,
    folder: Path,
    resume: bool,
    log: RunLog,
) -> Gaussians:
    if resume and (folder / GAUSSIANS).is_file():
        return Gaussians.load(folder / GAUSSIANS)
    with log.stage("load views"):
        views = load_views(frames, config.train.device)
    with log.stage("prepare kernels"):
        seeds = seed_gaussians(points, config.train.sh_degree, config.init.opacity)
        trainer = Trainer(seeds, views, config.train)
    if resume and (folder / CHECKPOINT).is_file():
        load_checkpoint(folder / CHECKPOINT, trainer)
    course = _Course(folder / TRAINING, trainer, test_views, log)
    try:
        with log.stage("train"):
            _run_steps(trainer, course, folder)
    except KeyboardInterrupt:
        save_checkpoint(folder / CHECKPOINT, trainer)
        raise
    finally:
        # Measuring the course is no training.
        log.seconds["train"] -= course.seconds
        log.seconds["measure course"] = log.seconds.get("measure course", 0.0) + course.seconds
        log.save(folder / RUN)
    gaussians = _without_transparent(trainer.gaussians.to_numpy())
    gaussians.save(folder / GAUSSIANS)
    (folder / CHECKPOINT).unlink(missing_ok=True)
    log.results |= {"gaussians": len(gaussians), "iterations": config.train.iterations}
    log.results["training_seconds"] = round(trainer.seconds, 3)
    return gaussians


def _without_transparent(gaussians: Gaussians) -> Gaussians:
    """Leave out what the training faded to nothing; strays far from the object would inflate its box."""
    keep = gaussians.opacities >= MIN_OPACITY
    return gaussians.select(keep) if keep.any() else gaussians


def _run_steps(trainer: Trainer, course: "_Course", folder: Path) -> None:
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


class _Course:
    """Writes training.jsonl: how loss and quality go along iterations and seconds."""

    def __init__(
        self, path: Path, trainer: Trainer, test_views: list[TestView], log: RunLog
    ) -> None:
        self.seconds = 0.0
        self._path = path
        self._trainer = trainer
        self._test_views = test_views
        self._quality = ""
        self._log = log
        self._lines = self._lines_before(trainer.optimizer.step)

    def record(self, measure: bool) -> str:
        """Add a line; return a few words for the progress bar."""
        start = time.perf_counter()
        trainer = self._trainer
        step = trainer.optimizer.step
        line: dict[str, Any] = {
            "iteration": step,
            "seconds": round(trainer.seconds, 4),
            "loss": trainer.loss_value() if step else None,
            "splats": len(trainer.gaussians),
        }
        if measure and self._test_views:
            images = render_views(trainer.gaussians, self._test_views)
            line |= mean_score(score_views(images, self._test_views))
            self._quality = f", held out {line['psnr']:.1f} dB"
        self._lines.append(json.dumps(line))
        write_atomically(self._path, ("\n".join(self._lines) + "\n").encode())
        self.seconds += time.perf_counter() - start
        return f"loss {line['loss']:.4f}{self._quality}" if step else ""

    def _lines_before(self, step: int) -> list[str]:
        """The lines of an interrupted run up to the checkpoint it goes on from."""
        if step == 0 or not self._path.is_file():
            return []
        lines = self._path.read_text(encoding="utf-8").splitlines()
        return [line for line in lines if json.loads(line)["iteration"] <= step]


def _write_evaluation(
    gaussians: Gaussians, views: list[TestView], device: str, folder: Path, log: RunLog
) -> None:
    """Render and measure the held-out views."""
    images = render_views(DeviceGaussians.from_numpy(gaussians, device), views)
    scores = score_views(images, views)
    for view, image in zip(views, images, strict=True):
        write_image(folder / RENDERS / f"{view.name}.png", to_uint8(image))
    mean = mean_score(scores)
    rows = [
        {key: None if value != value else value for key, value in asdict(score).items()}
        for score in scores
    ]
    record = {"views": rows, "mean": mean}
    write_atomically(folder / EVALUATION, to_json(record).encode())
    log.results["held_out"] = mean
