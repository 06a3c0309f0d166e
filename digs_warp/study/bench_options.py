"""`digs-warp bench options`: what each option of the training costs in time and brings in quality.

The built-in object is recorded (not timed) and initialized from its depth; the same start is trained once per
option, each alone beside the defaults.
"""

import tempfile
from pathlib import Path
from typing import Any

from digs_warp.device.parallel import default_threads
from digs_warp.init.config import InitConfig
from digs_warp.init.seed_gaussians import seed_gaussians
from digs_warp.record.progress import progress
from digs_warp.study.results import Result
from digs_warp.study.training_case import Case, Scene, SceneSize, record_scene, train_case
from digs_warp.train.config import TrainConfig

SIZE = SceneSize(640, 360, frames=32, voxel_size=0.005)
ITERATIONS = 400
MAX_SPLATS = 40_000

# The command line's spelling, and what it sets.
OPTIONS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("defaults", {}),
    ("--half-size-until 0", {"half_size_until": 0.0}),
    ("--sh-degree 3", {"sh_degree": 3}),
    ("--background white", {"background": "white"}),
    (
        "--background white --coverage-weight 0.1",
        {"background": "white", "coverage_weight": 0.1},
    ),
    ("--coverage-weight 0.1", {"coverage_weight": 0.1}),
    ("--depth-weight 0.02", {"depth_weight": 0.02}),
    ("--dssim-weight 0", {"dssim_weight": 0.0}),
    ("--density default", {"density": "default"}),
    ("--density absgrad", {"density": "absgrad"}),
    ("--density mcmc", {"density": "mcmc"}),
)


def bench_options(size: SceneSize = SIZE, iterations: int = ITERATIONS) -> list[Result]:
    """Return time of a step [ms], PSNR of held-out views [dB] and Gaussians at the end, per option."""
    results: list[Result] = []
    with tempfile.TemporaryDirectory() as folder:
        scene = record_scene(size, Path(folder) / "capture")
        with progress(len(OPTIONS), "Training", "option") as bar:
            for name, values in OPTIONS:
                config = TrainConfig(iterations=iterations, max_splats=MAX_SPLATS, **values)
                results += _measure(name, config, scene, f"{size.width}x{size.height}")
                bar.update()
    return results


def _measure(name: str, config: TrainConfig, scene: Scene, image: str) -> list[Result]:
    init = InitConfig()
    seeds = seed_gaussians(scene.points, config.sh_degree, init.seed_opacity, init.seed_width)
    (end,) = train_case(Case(name, seeds, config), scene)
    settings = {
        "image": image,
        "start": len(seeds),
        "iterations": config.iterations,
        "threads": default_threads(),
        "option": name,
    }
    step = 1e3 * end.seconds / max(1, config.iterations)
    return [
        Result("step [ms]", step, "ms", settings),
        Result("held-out PSNR [dB]", end.psnr, "dB", settings),
        Result("Gaussians", end.splats, "", settings),
    ]
