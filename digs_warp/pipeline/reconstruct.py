"""Capture -> Gaussians: poses, initialization, training and evaluation, each stage cached and resumable.

The folder that `reconstruct` leaves behind is described in docs/reconstruction-format.md.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from digs_warp.data.capture import Capture, Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import to_uint8, write_image
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.seed_gaussians import seed_gaussians
from digs_warp.pipeline.front_end import FrontEndConfig, front_end
from digs_warp.record.files import to_json, write_atomically
from digs_warp.record.layout import EVALUATION, GAUSSIANS, RUN_RECORD
from digs_warp.record.run_log import RunLog
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.config import TrainConfig
from digs_warp.train.evaluate import (
    TestView,
    load_test_views,
    mean_score,
    render_views,
    score_views,
)
from digs_warp.train.session import train_gaussians

RENDERS = "renders"


@dataclass(frozen=True, kw_only=True)
class ReconstructConfig(FrontEndConfig):
    """How a capture becomes Gaussians."""

    train: TrainConfig = field(default_factory=TrainConfig)


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
        log.continue_from(folder / RUN_RECORD)
    log.save(folder / RUN_RECORD)
    try:
        frames, points = front_end(capture, config, folder, log, resume)
    finally:
        log.save(folder / RUN_RECORD)
    log.results["initial_points"] = len(points)
    with log.stage("load views"):
        test_views = load_test_views(frames.held_out)
    gaussians = _train(frames.training, test_views, points, config, folder, resume, log)
    with log.stage("evaluate"):
        _write_evaluation(gaussians, test_views, config.train.device, folder, log)
    log.save(folder / RUN_RECORD)
    return gaussians


def _train(
    frames: Sequence[Frame],
    test_views: Sequence[TestView],
    points: PointCloud,
    config: ReconstructConfig,
    folder: Path,
    resume: bool,
    log: RunLog,
) -> Gaussians:
    if resume and (folder / GAUSSIANS).is_file():
        return Gaussians.load(folder / GAUSSIANS)
    init = config.init
    seeds = seed_gaussians(points, config.train.sh_degree, init.seed_opacity, init.seed_width)
    try:
        return train_gaussians(seeds, frames, test_views, config.train, folder, log, resume)
    finally:
        log.save(folder / RUN_RECORD)


def _write_evaluation(
    gaussians: Gaussians, views: Sequence[TestView], device: str, folder: Path, log: RunLog
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
