"""`python -m studies training`: what a training step costs, stage by stage, at three image sizes.

The built-in object is recorded from a few views (not timed), initialized from its depth, and trained for some
steps. Then the stages of the last step run again in the order of a step, so that each finds the caches as in
a step. Times are medians, so that the sum of the stages is comparable to a step.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.device.threads import default_threads
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from digs_warp.init.seeds import seed_gaussians
from digs_warp.record.progress import progress
from digs_warp.train.config import TrainConfig
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views
from studies.results import Result
from studies.timing import best_ms

# Image sizes and, for each, the voxel size [m] that gives it the points it can use.
SIZES = ((640, 360, 0.005), (960, 540, 0.004), (1600, 900, 0.003))
FRAMES = 6
WARM_UP_STEPS = 5
STEPS = 20
GRAY = np.full(3, 0.5)
SUMS = "gather and project back"


def bench_train() -> list[Result]:
    """Return the median time of a whole step and of each of its stages.

    "outside raster" is the share of the stages that is spent outside the two passes of the rasterizer;
    "outside raster with sums" also counts the sums of its gradients, and the projection back that is fused
    with them, as rasterizer.
    """
    results = []
    with progress(len(SIZES), "Measuring", "size") as bar, tempfile.TemporaryDirectory() as folder:
        for width, height, voxel_size in SIZES:
            capture = _record(width, height, Path(folder) / f"{width}x{height}")
            trainer = _prepare(capture, voxel_size)
            step = _median_step(trainer)
            stages = _stages(trainer)
            whole = sum(stages.values())
            raster = stages["forward"] + stages["backward"]
            labels = {
                "image": f"{width}x{height}",
                "splats": len(trainer.gaussians),
                "pairs": trainer.renderer.middle.binner.total_pairs,
                "threads": default_threads(),
            }
            values = {f"{name} [ms]": time for name, time in ({"step": step} | stages).items()}
            values["outside raster [%]"] = 100 * (1 - raster / whole)
            values["outside raster with sums [%]"] = 100 * (1 - (raster + stages[SUMS]) / whole)
            results.append(Result(labels, values, "step"))
            bar.update()
    return results


def _record(width: int, height: int, folder: Path) -> Capture:
    from digs_warp.sim.record.record import SimulateConfig, simulate

    config = SimulateConfig(
        frames=FRAMES, width=width, height=height, samples_per_pixel=1, tier="law"
    )
    return simulate(config, folder)


def _prepare(capture: Capture, voxel_size: float) -> Trainer:
    init = InitConfig(voxel_size=voxel_size)
    points = initial_points(capture.frames, init)
    config = TrainConfig()
    views = open_views(capture.frames, config)
    seeds = seed_gaussians(points, config.usual_sh_degree, init.seed_opacity, init.seed_width)
    trainer = Trainer(seeds, views, config)
    # The middle of a run: the color has all its bands.
    trainer.optimizer.step = config.stop.iterations // 2
    for _ in range(WARM_UP_STEPS):
        trainer.step()
    return trainer


def _median_step(trainer: Trainer) -> float:
    """Return the median time of a step [ms]."""
    return float(np.median([best_ms(trainer.step, 1) for _ in range(STEPS)]))


def _stages(trainer: Trainer) -> dict[str, float]:
    """Return the median time [ms] of every stage, run in the order of a step."""
    stages: dict[str, Callable[[], object]] = trainer.renderer.middle.stages()
    # Another view than that of the last step would differ from its image in other parts, and in more.
    view = trainer.views.view(trainer.optimizer.step - 1)
    stages["loss"] = lambda: trainer.objective.compare(view, GRAY)
    stages["adam"] = lambda: trainer.optimizer.update(0.0)
    order = ("project", "bin", "forward", "loss", "backward", SUMS, "adam")
    rounds = [[best_ms(stages[name], 1) for name in order] for _ in range(STEPS)]
    return dict(zip(order, np.median(rounds, axis=0).tolist(), strict=True))
