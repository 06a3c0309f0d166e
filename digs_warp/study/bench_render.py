"""`digs-warp bench render`: the frame rate of a film, once everything is loaded and compiled.

The built-in object is recorded and trained for a while (not timed); an orbit of it is filmed at several
image sizes, with one thread and with all.
"""

from digs_warp.camera import Intrinsics
from digs_warp.data.gaussians import Gaussians
from digs_warp.device.parallel import default_threads
from digs_warp.film.camera_path import find_subject, orbit
from digs_warp.film.shoot import Clock, shoot
from digs_warp.record.progress import progress
from digs_warp.study.results import Result
from digs_warp.study.trained_object import trained_object

SIZES = ((640, 360), (1280, 720), (1600, 900))
FRAMES = 25  # the first of them is not counted: it loads kernels
FOV_DEG = 45.0


def bench_render() -> list[Result]:
    """Return the frame rates of the built-in object, see `measure_films`."""
    return measure_films(trained_object().gaussians)


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
