"""`digs-warp bench convergence`: how fast held-out views get better, against the settings of 3DGS.

The built-in object is recorded (not timed) and initialized from its depth; the same points are then trained
twice, with the defaults for a dense start and with the start and the rates of the 3DGS reference. Seconds are
those of training steps: measuring the views does not count.
"""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from digs_warp.capture import Capture
from digs_warp.gaussians import Gaussians
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from digs_warp.init.seed_gaussians import INITIAL_OPACITY, seed_gaussians
from digs_warp.log import progress
from digs_warp.parallel import default_threads
from digs_warp.point_cloud import PointCloud
from digs_warp.study.results import Result
from digs_warp.train.config import REFERENCE_RATES, TrainConfig
from digs_warp.train.evaluate import TestView, load_test_views, render_views, score_views
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import ViewStore, open_views

WIDTH, HEIGHT = 960, 540
FRAMES = 32
VOXEL_SIZE = 0.003  # [m]
ITERATIONS = 300
MEASURE_AT = (0, 10, 25, 50, 100, 150, 200, 300)
SH_DEGREE = 1

DENSE, REFERENCE = "dense start", "3DGS"


@dataclass(frozen=True)
class Case:
    """A start and how it is trained."""

    name: str
    seeds: Gaussians
    config: TrainConfig


def bench_convergence(
    width: int = WIDTH,
    height: int = HEIGHT,
    frames: int = FRAMES,
    iterations: int = ITERATIONS,
    voxel_size: float = VOXEL_SIZE,
) -> list[Result]:
    """Return PSNR [dB] of the held-out views along iterations and seconds, for both settings."""
    results: list[Result] = []
    with tempfile.TemporaryDirectory() as folder:
        capture = _record(width, height, frames, Path(folder) / "capture")
        train_frames, test_frames = capture.split()
        test_views = load_test_views(test_frames)
        points = initial_points(train_frames, InitConfig(voxel_size=voxel_size))
        cases = _cases(points, iterations)
        with progress(len(cases) * iterations, "Training both settings") as bar:
            for case in cases:
                views = open_views(train_frames, case.config)
                results += _train(case, views, test_views)
                bar.update(iterations)
                views.close()
    return results


def _record(width: int, height: int, frames: int, folder: Path) -> Capture:
    from sim.record import SimulateConfig, simulate

    config = SimulateConfig(frames=frames, width=width, height=height, tier="law")
    return simulate(config, folder)


def _cases(points: PointCloud, iterations: int) -> list[Case]:
    init = InitConfig()
    dense = TrainConfig(iterations=iterations, sh_degree=SH_DEGREE)
    r = REFERENCE_RATES
    reference = replace(
        dense,
        means_rate=r.means,
        scales_rate=r.scales,
        quats_rate=r.quats,
        opacities_rate=r.opacities,
        colors_rate=r.colors,
        rates_end=r.end,
        half_size_until=0.0,
    )
    return [
        Case(DENSE, seed_gaussians(points, SH_DEGREE, init.seed_opacity, init.seed_width), dense),
        Case(REFERENCE, seed_gaussians(points, SH_DEGREE, INITIAL_OPACITY), reference),
    ]


def _train(case: Case, views: ViewStore, test_views: list[TestView]) -> list[Result]:
    """Train and measure along the way."""
    trainer = Trainer(case.seeds, views, case.config)
    k = views.cameras[0].intrinsics
    shared = {
        "image": f"{k.width}x{k.height}",
        "splats": len(case.seeds),
        "threads": default_threads(),
        "settings": case.name,
    }
    results = []
    for step in range(case.config.iterations + 1):
        if step in MEASURE_AT or step == case.config.iterations:
            scores = score_views(render_views(trainer.gaussians, test_views), test_views)
            psnr = float(np.mean([score.psnr for score in scores]))
            at = {"iteration": step, "seconds": round(trainer.seconds, 2)}
            results.append(Result("held-out PSNR", psnr, "dB", shared | at))
        if step < case.config.iterations:
            trainer.step()
    return results
