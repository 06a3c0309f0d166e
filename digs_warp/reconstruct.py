"""Capture -> Gaussians: initialization, training and evaluation, each stage cached and resumable.

The folder that `reconstruct` leaves behind is described in docs/reconstruction-format.md.
"""

from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from digs_warp.capture import Capture, Frame
from digs_warp.checks import DigsError
from digs_warp.gaussians import Gaussians
from digs_warp.images import to_uint8, write_image
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from digs_warp.init.seed_gaussians import seed_gaussians
from digs_warp.log import RunLog, to_json, write_arrays, write_atomically
from digs_warp.point_cloud import PointCloud
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.config import TrainConfig
from digs_warp.train.evaluate import (
    TestView,
    load_test_views,
    mean_score,
    render_views,
    score_views,
)
from digs_warp.train.session import GAUSSIANS, train_gaussians

POINTS = "initial_points.npz"
EVALUATION = "evaluation.json"
RENDERS = "renders"
RUN = "run.json"


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
    seeds = seed_gaussians(points, config.train.sh_degree, config.init.opacity)
    try:
        return train_gaussians(seeds, frames, test_views, config.train, folder, log, resume)
    finally:
        log.save(folder / RUN)


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
