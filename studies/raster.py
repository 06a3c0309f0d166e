"""`python -m studies raster`: the stages of the CPU rasterizer on one thread and on more, all in one run.

Two scenes of random splats that fill the image (no culling helps): "broad" with radii around 4 px at
1600x896, and "fine" with 1 to 4 px at 1280x720. Times are the best of several launches after a warm-up, so
compilation does not count. Absolute times belong to the machine; the ratios are the point.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.device.threads import default_threads
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.sh import sh_from_rgb
from digs_warp.record.progress import progress
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import SplatRenderer
from studies.results import Result
from studies.timing import best_ms, clock_for

NEAR = 0.1
_FOCAL = 1000.0


@dataclass(frozen=True)
class RasterScene:
    """Random splats that cover an image evenly."""

    name: str
    width: int
    height: int
    splats: int
    radii: Callable[[np.random.Generator, int], np.ndarray]

    def gaussians(self) -> Gaussians:
        """Flat Gaussians one metre before the camera: their standard deviations in pixels are ``radii``."""
        rng = np.random.default_rng(0)
        n = self.splats
        px = rng.uniform(0, (self.width, self.height), (n, 2))
        sigma = self.radii(rng, n)
        angle = rng.uniform(0, np.pi, n)
        opacity = rng.uniform(0.05, 0.9, n)
        zero = np.zeros(n)
        depth = rng.uniform(1.0, 1.001, n)
        x = (px[:, 0] - self.width / 2) / _FOCAL * depth
        y = (px[:, 1] - self.height / 2) / _FOCAL * depth
        return Gaussians(
            means=np.stack([x, y, depth], axis=1),
            log_scales=np.log(np.concatenate([sigma / _FOCAL, np.full((n, 1), 1e-6)], axis=1)),
            quats=np.stack([zero, zero, np.sin(angle / 2), np.cos(angle / 2)], axis=1),
            opacity_logits=np.log(opacity / (1 - opacity)),
            sh=sh_from_rgb(rng.uniform(size=(n, 1, 3))),
        )

    def camera(self) -> Camera:
        """A camera at the origin that looks along z."""
        center = (self.width / 2, self.height / 2)
        return Camera(Intrinsics(self.width, self.height, _FOCAL, _FOCAL, *center), np.eye(4))


SCENES = (
    RasterScene(
        "broad", 1600, 896, 100_000, lambda rng, n: rng.lognormal(np.log(4.0), 0.5, (n, 2))
    ),
    RasterScene("fine", 1280, 720, 100_000, lambda rng, n: rng.uniform(1.0, 4.0, (n, 2))),
)


def bench_raster(scenes: tuple[RasterScene, ...] = SCENES) -> list[Result]:
    """Return the times of every stage."""
    threads = sorted({1, 2, default_threads()})
    results = []
    with progress(len(scenes) * len(threads), "Measuring", "variant") as bar:
        for scene in scenes:
            gaussians = DeviceGaussians.from_numpy(scene.gaussians())
            for count in threads:
                times, pairs = stage_times(scene, gaussians, count)
                labels = {
                    "scene": scene.name,
                    "image": f"{scene.width}x{scene.height}",
                    "splats": scene.splats,
                    "pairs": pairs,
                    "threads": count,
                }
                values = {f"{stage} [ms]": time for stage, time in times.items()}
                results.append(Result(labels, values, "stages"))
                bar.update()
    return results


def stage_times(
    scene: RasterScene, gaussians: DeviceGaussians, threads: int, repeats: int = 7
) -> tuple[dict[str, float], int]:
    """Return the times [ms] of the stages of a view and its gradient, and its (tile, splat) pairs."""
    renderer = SplatRenderer(gaussians, scene.width, scene.height, threads=threads)
    camera = scene.camera()
    rng = np.random.default_rng(1)
    renderer.adj_image.assign(rng.normal(size=(scene.height, scene.width, 3)))
    renderer.forward(camera, near=NEAR)
    renderer.backward()
    clock, stages = clock_for(threads), renderer.stages().items()
    times = {name: best_ms(stage, repeats, clock=clock) for name, stage in stages}
    return times, renderer.binner.total_pairs
