"""`python -m studies masks`: masks that need no network, compared with the true ones.

The built-in object is recorded by the simulated camera with all its sensor errors.
"""

import tempfile
from pathlib import Path

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.data.images import read_image
from digs_warp.masks.config import SegmentConfig
from digs_warp.masks.masks import segment
from digs_warp.study.timing import Stopwatch
from studies.results import Result

FRAMES, WIDTH = 9, 640

CASES = (("depth", SegmentConfig(masks="depth")),)


def bench_masks() -> list[Result]:
    """Return the overlap with the true masks (intersection over union) and the time per mask."""
    from digs_warp.sim.record.record import SimulateConfig, simulate

    results = []
    with tempfile.TemporaryDirectory() as folder:
        config = SimulateConfig(frames=FRAMES, width=WIDTH, samples_per_pixel=2)
        frames = simulate(config, Path(folder) / "capture").frames
        for name, settings in CASES:
            with Stopwatch() as watch:
                paths = segment(frames, settings, Path(folder) / name)
            overlaps = [
                intersection_over_union(read_image(path)[..., 0], frame.load_mask())
                for path, frame in zip(paths, frames, strict=True)
            ]
            values = {
                "overlap mean": float(np.mean(overlaps)),
                "overlap worst": min(overlaps),
                "seconds per mask [s]": watch.seconds / len(frames),
            }
            results.append(Result({"masks": name, "frames": FRAMES, "width": WIDTH}, values))
    return results


def intersection_over_union(mask: np.ndarray, truth: np.ndarray, threshold: int = 127) -> float:
    """Return the share of pixels in both masks among those in either, 0 to 1; two empty masks agree fully.

    Args:
        mask: shape (height, width), uint8.
        truth: of the same shape.
        threshold: values above it are object.
    """
    check_shape("mask", mask, truth.shape)
    a, b = mask > threshold, truth > threshold
    either = np.count_nonzero(a | b)
    return np.count_nonzero(a & b) / either if either else 1.0
