"""Train a simulated recording under given settings and measure the held-out views along the way."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from digs_warp.train.config import TrainConfig
from digs_warp.train.evaluate import TestView, load_test_views, render_views, score_views
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views


@dataclass(frozen=True)
class Case:
    """A start and how it is trained."""

    name: str
    seeds: Gaussians
    config: TrainConfig


@dataclass(frozen=True)
class Scene:
    """A recording split into training and held-out views, and the points that its depth gives."""

    train_frames: list[Frame]
    test_views: list[TestView]
    points: PointCloud


@dataclass(frozen=True)
class Milestone:
    """Where a run stands: steps taken, training seconds, PSNR of the held-out views [dB], Gaussians."""

    iteration: int
    seconds: float
    psnr: float
    splats: int


@dataclass(frozen=True)
class SceneSize:
    """How large a recording is, and how fine its start: pixels, frames, edge of the voxels [m]."""

    width: int
    height: int
    frames: int
    voxel_size: float


def record_scene(size: SceneSize, folder: Path, mesh: Path | None = None) -> Scene:
    """Record a mesh with the depth law of a stereo camera and initialize from its depth.

    Args:
        size: of the recording and of the start.
        folder: where the capture goes.
        mesh: the object; default: the built-in one.
    """
    from digs_warp.sim.record import SimulateConfig, simulate

    config = SimulateConfig(
        mesh=mesh, frames=size.frames, width=size.width, height=size.height, tier="law"
    )
    capture = simulate(config, folder)
    train_frames, test_frames = capture.split()
    points = initial_points(train_frames, InitConfig(voxel_size=size.voxel_size))
    return Scene(train_frames, load_test_views(test_frames), points)


def train_case(
    case: Case,
    scene: Scene,
    measure_at: Collection[int] = (),
    after_step: Callable[[], object] = lambda: None,
) -> list[Milestone]:
    """Train, and measure at the given iterations and at the end; measuring takes no training seconds.

    ``after_step`` is called after each, to show progress.
    """
    views = open_views(scene.train_frames, case.config)
    trainer = Trainer(case.seeds, views, case.config)
    total = case.config.iterations
    milestones = []
    for step in range(total + 1):
        if step in measure_at or step == total:
            images = render_views(trainer.gaussians, scene.test_views)
            psnr = np.mean([score.psnr for score in score_views(images, scene.test_views)])
            milestones.append(Milestone(step, trainer.seconds, float(psnr), len(trainer.gaussians)))
        if step < total:
            trainer.step()
            after_step()
    views.close()
    return milestones
