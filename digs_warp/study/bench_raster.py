"""`digs-warp bench raster`: the vectorized CPU rasterizer against the plain one, all in one run.

Two scenes of random splats that fill the image (no culling helps): "broad" with radii around 4 px at
1600x896, and "fine" with 1 to 4 px at 1280x720. Times are the best of several launches after a warm-up, so
compilation does not count. Absolute times belong to the machine; the ratios are the point.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.camera import Camera, Intrinsics
from digs_warp.gaussians import Gaussians
from digs_warp.log import progress
from digs_warp.parallel import default_threads
from digs_warp.sh import sh_from_rgb
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import SplatRenderer
from digs_warp.study.results import Result

_NEAR = 0.1
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
    """Return times [ms] of every stage and kernel, and how many times faster than the plain kernel."""
    threads = sorted({1, 2, default_threads()})
    variants = [("plain", 1), *(("vectorized", count) for count in threads)]
    results: list[Result] = []
    with progress(len(scenes) * len(variants), "Measuring", "variant") as bar:
        for scene in scenes:
            gaussians = DeviceGaussians.from_numpy(scene.gaussians())
            plain: dict[str, float] = {}
            for kernel, count in variants:
                times, pairs = _measure(scene, gaussians, kernel == "vectorized", count)
                settings = {
                    "scene": scene.name,
                    "image": f"{scene.width}x{scene.height}",
                    "splats": scene.splats,
                    "pairs": pairs,
                    "kernel": kernel,
                    "threads": count,
                }
                for stage, milliseconds in times.items():
                    results.append(Result(stage, milliseconds, "ms", settings))
                    before = plain.setdefault(stage, milliseconds)
                    if kernel != "plain":
                        ratio = before / milliseconds
                        results.append(Result(f"{stage} speed-up", ratio, "x plain", settings))
                bar.update()
        results += _measure_sorts()
    return results


def _measure(
    scene: RasterScene, gaussians: DeviceGaussians, vectorized: bool, threads: int
) -> tuple[dict[str, float], int]:
    """Return the times [ms] of the stages of one variant, and its number of (tile, splat) pairs."""
    renderer = SplatRenderer(
        gaussians, scene.width, scene.height, vectorized=vectorized, threads=threads
    )
    camera = scene.camera()
    rng = np.random.default_rng(1)
    renderer.adj_image.assign(rng.normal(size=(scene.height, scene.width, 3)))
    renderer.forward(camera, near=_NEAR)
    renderer.backward()
    repeats = 7 if vectorized else 2  # the plain kernels take seconds
    stages = renderer.stages()
    times = {name: best_time(stage, repeats) for name, stage in stages.items()}
    return times, renderer.binner.total_pairs


def _measure_sorts(keys: int = 800_000) -> list[Result]:
    """Return the times of Warp's radix sort, which one depth sort of all splats replaces."""
    results = []
    for dtype, bits in ((wp.int64, 40), (wp.int32, 31)):
        random = np.random.default_rng(0).integers(0, 2**bits, 2 * keys)
        sorted_keys = wp.array(random, dtype=dtype, device="cpu")
        values = wp.array(np.arange(2 * keys), dtype=int, device="cpu")

        def restore(array: wp.array = sorted_keys, source: np.ndarray = random) -> None:
            array.assign(source)

        def sort(array: wp.array = sorted_keys, order: wp.array = values) -> None:
            wp.utils.radix_sort_pairs(array, order, keys)

        best = best_time(sort, 5, restore)
        results.append(Result("radix sort", best, "ms", {"keys": keys, "key": dtype.__name__}))
    return results


def best_time(
    function: Callable[[], object], repeats: int, before: Callable[[], object] | None = None
) -> float:
    """Return the shortest of ``repeats`` calls [ms]; ``before`` runs ahead of each and does not count."""
    shortest = np.inf
    for _ in range(repeats):
        if before is not None:
            before()
        start = time.perf_counter()
        function()
        shortest = min(shortest, time.perf_counter() - start)
    return 1e3 * float(shortest)
