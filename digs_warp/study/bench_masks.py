"""`digs-warp bench masks`: how well masks without a network fit the true ones, on simulated recordings.

The built-in object is recorded by the simulated camera with all errors that its sensor makes.
"""

import tempfile
import time
from pathlib import Path

import numpy as np

from digs_warp.data.images import read_image
from digs_warp.segment.config import SegmentConfig
from digs_warp.segment.masks import segment
from digs_warp.segment.score import intersection_over_union
from digs_warp.study.results import Result

FRAMES, WIDTH = 9, 640

CASES = (
    ("depth", SegmentConfig(masks="depth")),
    *(
        (f"degraded, {error:g}", SegmentConfig(masks="degraded", mask_error=error))
        for error in (0.5, 1.0, 2.0, 4.0)
    ),
)


def bench_masks() -> list[Result]:
    """Return intersection over union with the true masks, and the time per mask [s], of each source."""
    from digs_warp.sim.record import SimulateConfig, simulate

    results = []
    with tempfile.TemporaryDirectory() as folder:
        config = SimulateConfig(frames=FRAMES, width=WIDTH, samples_per_pixel=2)
        frames = simulate(config, Path(folder) / "capture").frames
        for name, settings in CASES:
            start = time.perf_counter()
            paths = segment(frames, settings, Path(folder) / name)
            seconds = (time.perf_counter() - start) / len(frames)
            overlaps = [
                intersection_over_union(read_image(path)[..., 0], frame.load_mask())
                for path, frame in zip(paths, frames, strict=True)
            ]
            shared = {"masks": name, "frames": FRAMES, "width": WIDTH}
            results += [
                Result("overlap mean", float(np.mean(overlaps)), "", shared),
                Result("overlap worst", min(overlaps), "", shared),
                Result("seconds per mask", seconds, "s", shared),
            ]
    return results
