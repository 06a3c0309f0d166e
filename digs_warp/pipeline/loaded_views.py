"""What is read of the frames before a training."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from digs_warp.data.gaussians import Gaussians
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.first_exposures import first_exposures, without_exposure
from digs_warp.init.seen_colors import look_up
from digs_warp.init.view_dependence import ViewDependence, view_dependence
from digs_warp.pipeline.prepared import Prepared
from digs_warp.train.config import TrainConfig
from digs_warp.train.evaluate import TestView, load_test_views
from digs_warp.train.session import TrainingData, open_data
from digs_warp.train.shutter import ShutterPlan


@dataclass(frozen=True, eq=False)
class LoadedViews:
    """What is read of the frames.

    Attributes:
        data: to train on; None without a training.
        held_out: to measure.
        color: what the photographs show of the color; None where the settings say its degree.
        points: to start from, in the colors of photographs of one exposure if that is fitted.
    """

    data: TrainingData | None
    held_out: Sequence[TestView]
    color: ViewDependence | None
    points: PointCloud


def load_views(
    prepared: Prepared,
    seeds: Gaussians | None,
    shutter: ShutterPlan,
    config: TrainConfig,
    folder: Path,
    resume: bool,
) -> LoadedViews:
    """Read the views; what takes one core is done beside the reading for the training.

    Args:
        prepared: the frames, and the points to start from.
        seeds: the Gaussians to start from, in any color; None: there is no training.
        shutter: how the cameras move while their rows are read.
        config: of the training.
        folder: of the training.
        resume: whether the training continues from a checkpoint.

    Raises:
        DigsError: bad views, or a broken checkpoint.
    """
    frames = prepared.frames.training
    with ThreadPoolExecutor(2) as beside:
        opening = None
        if seeds is not None:
            opening = beside.submit(open_data, frames, config, folder, resume, shutter, seeds)
        held_out = load_test_views(prepared.frames.held_out, shutter)
        points, judging, constant = prepared.start.points, None, False
        evens = seeds is not None and config.fit_exposure == "on"
        if evens or config.sh_degree is None:
            seen = look_up(frames, points.points_world)
            if config.sh_degree is None:
                judging = beside.submit(view_dependence, seen)
            found = first_exposures(points, frames, seen) if evens else None
            if found is not None:
                points, constant = without_exposure(points, frames, found), not found.vary
        data = replace(opening.result(), constant_exposure=constant) if opening else None
        return LoadedViews(data, held_out, judging.result() if judging else None, points)
