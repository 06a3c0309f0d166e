"""`python -m studies usd`: USD scenes of a million splats, and what each precision costs and loses.

Random splats of degree 3 are written to a new file and read back to Gaussians: the least seconds of the
processor of several rounds. PSNR: a smaller scene is written, read, rendered, and compared with what was.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import get_args

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.record.progress import progress
from digs_warp.splat.render import render
from digs_warp.usd.convert import Precision
from digs_warp.usd.reader import read_gaussians
from digs_warp.usd.writer import write_gaussians
from studies.results import Result

SPLATS = 1_000_000
PICTURED_SPLATS = 100_000
DEGREE = 3
REPEATS = 5
_VIEWS = 3


def bench_usd(splats: int = SPLATS, pictured: int = PICTURED_SPLATS) -> list[Result]:
    """Return times of the processor [s], sizes and the PSNR of rendered views [dB] for every precision."""
    large, small = random_splats(splats), random_splats(pictured)
    pictures = _views_of(small)
    precisions: tuple[Precision, ...] = get_args(Precision)
    results: list[Result] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        progress(len(precisions), "Measuring", "case") as bar,
    ):
        path = Path(folder) / "scene.usdz"
        for precision in precisions:
            write_gaussians(path, small, precision=precision)
            psnr = _psnr(pictures, _views_of(read_gaussians(path)))
            labels = {"precision": precision, "splats": splats, "degree": DEGREE}
            results.append(Result(labels, _measure(large, path, precision) | {"PSNR [dB]": psnr}))
            bar.update()
    return results


def _measure(gaussians: Gaussians, path: Path, precision: Precision) -> dict[str, float]:
    """Return times and size of one file."""
    write = _least_seconds(lambda: write_gaussians(path, gaussians, precision=precision))
    read = _least_seconds(lambda: read_gaussians(path))
    return {"write [s]": write, "read [s]": read, "size [MB]": path.stat().st_size / 1e6}


def _least_seconds(work: Callable[[], object]) -> float:
    """Return how long the processor works [s], all threads together."""
    found = []
    for _ in range(REPEATS):
        start = time.process_time()
        work()
        found.append(time.process_time() - start)
    return min(found)


def random_splats(count: int) -> Gaussians:
    """Return splats all over a cubic metre, of every shape, with colors that change with the direction."""
    rng = np.random.default_rng(0)
    size = count ** (-1 / 3)  # about as large as they are apart
    sh = rng.normal(0.0, 0.1, (count, (DEGREE + 1) ** 2, 3))
    sh[:, 0] = rng.normal(0.0, 0.8, (count, 3))
    return Gaussians(
        means=rng.uniform(-0.5, 0.5, (count, 3)),
        log_scales=rng.normal(np.log(0.4 * size), 0.7, (count, 3)),
        quats=rng.normal(size=(count, 4)),
        opacity_logits=rng.normal(0.0, 2.0, count),
        sh=sh,
    )


def _views_of(gaussians: Gaussians) -> list[np.ndarray]:
    """Render the cube from all sides."""
    intrinsics = Intrinsics.from_fov(640, 360, 50.0)
    up = np.array([0.0, 0.0, 1.0])
    eyes = [
        2.0 * np.array([np.cos(angle), np.sin(angle), 0.4])
        for angle in 2 * np.pi * np.arange(_VIEWS) / _VIEWS
    ]
    return [
        render(gaussians, Camera(intrinsics, look_at(eye, np.zeros(3), up))).image for eye in eyes
    ]


def _psnr(expected: list[np.ndarray], found: list[np.ndarray]) -> float:
    """Return the PSNR over all views [dB], capped at 120: the pictures are float32."""
    error = np.mean(
        [((a - b) ** 2).mean(dtype=np.float64) for a, b in zip(expected, found, strict=True)]
    )
    return float(min(120.0, -10 * np.log10(max(error, 1e-12))))
