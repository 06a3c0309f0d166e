"""What can still be chosen after the training: how faint splats are drawn, how exactly they are stored."""

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean, median
from typing import Any, get_args

import numpy as np

from digs_warp.data.capture import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.measure.metrics import psnr

# Smallest alpha that is drawn; the first is the usual one, a step of an 8-bit image.
ALPHA_CUTS = (1 / 255, 0.02, 0.05, 0.1)
# Each view is drawn this often; the median counts.
REPEATS = 3


def score_finishes(
    gaussians: Gaussians, frames: Sequence[Frame]
) -> dict[str, list[dict[str, Any]]]:
    """Draw and store a result in different ways; it is not trained again.

    Returns:
        ``alpha_cuts``: for each cut ``value``, ``seconds`` per view, ``psnr`` [dB] on ``frames``;
        ``precisions``: for each ``value`` ``seconds`` to write a .usdc file, its ``megabytes``, and the
        ``psnr`` of what is read back.
    """
    return {
        "alpha_cuts": [_with_cut(gaussians, frames, cut) for cut in ALPHA_CUTS],
        "precisions": _precisions(gaussians, frames),
    }


def _with_cut(gaussians: Gaussians, frames: Sequence[Frame], cut: float) -> dict[str, Any]:
    from digs_warp.splat.config import RasterOptions
    from digs_warp.splat.device import DeviceGaussians
    from digs_warp.splat.footprint import near_plane
    from digs_warp.splat.renderer import SplatRenderer
    from digs_warp.train.evaluate import load_test_views

    views = load_test_views(frames)
    k = views[0].camera.intrinsics
    splats = DeviceGaussians.from_numpy(gaussians)
    renderer = SplatRenderer(splats, k.width, k.height, options=RasterOptions(min_alpha=cut))
    center = gaussians.means.mean(axis=0)
    seconds, scores = [], []
    for view in views:
        for _ in range(REPEATS):
            start = time.perf_counter()
            renderer.forward(view.camera, near=near_plane(view.camera, center))
            seconds.append(time.perf_counter() - start)
        scores.append(psnr(np.clip(renderer.image.to_numpy(), 0.0, 1.0), view.target))
    return {"value": round(cut, 4), "seconds": median(seconds), "psnr": fmean(scores)}


def _precisions(gaussians: Gaussians, frames: Sequence[Frame]) -> list[dict[str, Any]]:
    from digs_warp.splat.device import DeviceGaussians
    from digs_warp.train.evaluate import load_test_views, mean_score, render_views, score_views
    from digs_warp.usd.convert import Precision
    from digs_warp.usd.reader import read_gaussians
    from digs_warp.usd.writer import WriteOptions, write_gaussians

    views = load_test_views(frames)
    found = []
    for precision in get_args(Precision):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scene.usdc"
            start = time.perf_counter()
            write_gaussians(path, gaussians, options=WriteOptions(precision=precision))
            seconds = time.perf_counter() - start
            size = path.stat().st_size / 1e6
            stored = DeviceGaussians.from_numpy(read_gaussians(path))
        score = mean_score(score_views(render_views(stored, views), views))
        row = {"value": precision, "seconds": seconds, "megabytes": size, "psnr": score["psnr"]}
        found.append(row)
    return found
