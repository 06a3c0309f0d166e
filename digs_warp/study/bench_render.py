"""`digs-warp bench render`: the frame rate of a film, once everything is loaded and compiled.

The built-in object is recorded from a few views (not timed); every point of their depth becomes an opaque
Gaussian of its own size. An orbit of them is filmed at several image sizes, with one thread and with all.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.camera import Intrinsics
from digs_warp.film.camera_path import find_subject, orbit
from digs_warp.film.shoot import Clock, shoot
from digs_warp.gaussians import Gaussians
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from digs_warp.init.seed_gaussians import seed_gaussians
from digs_warp.log import progress
from digs_warp.parallel import default_threads
from digs_warp.study.results import Result

SIZES = ((640, 360), (1280, 720), (1600, 900))
FRAMES = 25  # the first of them is not counted: it loads kernels
RECORDED_FRAMES = 8
RECORDED_SIZE = (960, 540)
FOV_DEG = 45.0
OPAQUE_LOGIT = 3.0  # opacity 0.95, as of most splats of a trained object


def bench_render() -> list[Result]:
    """Return the frame rates of the built-in object, see `measure_films`."""
    return measure_films(_object())


def measure_films(
    gaussians: Gaussians, sizes: tuple[tuple[int, int], ...] = SIZES, frames: int = FRAMES
) -> list[Result]:
    """Return frames per second, and the mean time of a frame [ms], by image size and threads."""
    subject = find_subject(gaussians)
    threads = sorted({1, default_threads()})
    results: list[Result] = []
    with progress(len(sizes) * len(threads), "Measuring", "film") as bar:
        for width, height in sizes:
            cameras = orbit(subject, Intrinsics.from_fov(width, height, FOV_DEG), frames)
            for count in threads:
                clock = Clock()
                for _ in shoot(gaussians, cameras, threads=count, clock=clock):
                    pass
                settings = {
                    "image": f"{width}x{height}",
                    "splats": len(gaussians),
                    "sh_degree": gaussians.sh_degree,
                    "threads": count,
                }
                results.append(Result("frame rate", clock.frame_rate, "1/s", settings))
                results.append(Result("frame", clock.milliseconds, "ms", settings))
                bar.update()
    return results


def _object() -> Gaussians:
    """Return the built-in object as Gaussians of degree 3."""
    from sim.record import SimulateConfig, simulate

    width, height = RECORDED_SIZE
    config = SimulateConfig(
        frames=RECORDED_FRAMES, width=width, height=height, samples_per_pixel=1, tier="law"
    )
    with tempfile.TemporaryDirectory() as folder:
        capture = simulate(config, Path(folder) / "capture")
        gaussians = seed_gaussians(initial_points(capture.frames, InitConfig()), sh_degree=3)
    opaque = np.full(len(gaussians), OPAQUE_LOGIT, dtype=np.float32)
    return replace(gaussians, opacity_logits=opaque)
