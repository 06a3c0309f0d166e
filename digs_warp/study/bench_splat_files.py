"""`digs-warp bench splat-files`: what each file format of Gaussians takes, and what it loses.

The built-in object is recorded and trained for a while (not timed), written in every format, read again and
rendered from an orbit. PSNR is against renders of the Gaussians before they were written, over the pixels
that they cover: a file cannot be seen to differ much above 40 dB.
"""

import tempfile
import time
from pathlib import Path

import numpy as np

from digs_warp.camera import Camera, Intrinsics
from digs_warp.commands.splat_scenes import SplatOptions, read_splats, write_splats
from digs_warp.data.gaussians import Gaussians
from digs_warp.film.camera_path import find_subject, orbit
from digs_warp.measure.metrics import psnr
from digs_warp.record.layout import GAUSSIANS
from digs_warp.record.progress import progress
from digs_warp.splat.render import RenderOutput, render
from digs_warp.study.results import Result
from digs_warp.study.trained_object import trained_object

# Name, suffix, version of SPZ.
FORMATS = (
    ("npz", ".npz", 3),
    ("PLY", ".ply", 3),
    (".splat", ".splat", 3),
    ("SPZ 2", ".spz", 2),
    ("SPZ 3", ".spz", 3),
    ("SPZ 4", ".spz", 4),
    ("USD", ".usdz", 3),
)
VIEWS = 4
VIEW_SIZE = (960, 540)
COVERED = 0.5  # alpha


def bench_splat_files() -> list[Result]:
    """Return what the formats take and lose on the built-in object, see `measure_formats`."""
    return measure_formats(trained_object().gaussians)


def measure_formats(gaussians: Gaussians, view_size: tuple[int, int] = VIEW_SIZE) -> list[Result]:
    """Return bytes per Gaussian, seconds per million to write and read, and PSNR [dB], by format."""
    cameras = orbit(find_subject(gaussians), Intrinsics.from_fov(*view_size, 45.0), VIEWS)
    before = [render(gaussians, camera) for camera in cameras]
    results: list[Result] = []
    with tempfile.TemporaryDirectory() as folder, progress(len(FORMATS), "Measuring") as bar:
        source = Path(folder) / GAUSSIANS
        gaussians.save(source)
        for name, suffix, version in FORMATS:
            path = Path(folder) / f"scene{suffix}"
            start = time.perf_counter()
            write_splats(path, gaussians, source, SplatOptions(), version)
            written = time.perf_counter()
            read = read_splats(path, SplatOptions())
            seconds = {"write": written - start, "read": time.perf_counter() - written}
            settings = {"format": name, "splats": len(gaussians), "degree": gaussians.sh_degree}
            bytes_each = path.stat().st_size / len(gaussians)
            results.append(Result("size", bytes_each, "B/splat", settings))
            results += [
                Result(action, 1e6 * value / len(gaussians), "s/million", settings)
                for action, value in seconds.items()
            ]
            results.append(Result("PSNR", _likeness(read, cameras, before), "dB", settings))
            bar.update()
    return results


def _likeness(gaussians: Gaussians, cameras: list[Camera], before: list[RenderOutput]) -> float:
    """Return the mean PSNR [dB] over the pixels that the object covered before."""
    values = []
    for camera, view in zip(cameras, before, strict=True):
        image = render(gaussians, camera).image
        values.append(psnr(image, view.image, view.alpha > COVERED))
    return float(np.mean(values))
