"""`python -m studies raster`: the stages of the CPU rasterizer on one thread and on more, all in one run.

Two scenes of random splats that fill the image (no culling helps): "broad" with radii around 4 px at
1600x896, and "fine" with 1 to 4 px at 1280x720. Times are the best of several launches after a warm-up, so
compilation does not count. Absolute times belong to the machine; the ratios are the point, among them the
share of the rate of a matrix product: how much of what the core can do is used.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.device.threads import default_threads
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.sh import sh_from_rgb
from digs_warp.record.progress import progress
from digs_warp.splat.config import BLOCK_HEIGHT, BLOCK_WIDTH, TILE_SIZE
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.records import SPLAT_HALF_HEIGHT, SPLAT_HALF_WIDTH, SPLAT_U, SPLAT_V
from digs_warp.splat.render import SplatRenderer
from studies.results import Result
from studies.timing import best_ms, clock_for

# Additions and multiplications of one pixel and one splat; comparisons and selections not counted. Forward:
# power 6, exponential 15, opacity 1, transmittance 2, weights 2, three colors 6. Backward: the same up to
# the weight (25), light 5, what is still to come 2, d_alpha 4, d_power 1, six sums 12.
FORWARD_FLOPS = 32
BACKWARD_FLOPS = 49

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
    """Return the times of every stage, and how much of a core the raster kernels use."""
    threads = sorted({1, 2, default_threads()})
    results = []
    matrix_rate = measure_matrix_product()
    with progress(len(scenes) * len(threads), "Measuring", "variant") as bar:
        for scene in scenes:
            gaussians = DeviceGaussians.from_numpy(scene.gaussians())
            for count in threads:
                times, renderer = stage_times(scene, gaussians, count)
                labels = {
                    "scene": scene.name,
                    "image": f"{scene.width}x{scene.height}",
                    "splats": scene.splats,
                    "pairs": renderer.binner.total_pairs,
                    "threads": count,
                }
                values = {f"{stage} [ms]": time for stage, time in times.items()}
                results.append(Result(labels, values, "stages"))
                rates = _rates(renderer, times, count, matrix_rate)
                results.append(Result(labels, rates, "rates"))
                bar.update()
    return results


def stage_times(
    scene: RasterScene, gaussians: DeviceGaussians, threads: int, repeats: int = 7
) -> tuple[dict[str, float], SplatRenderer]:
    """Return the times [ms] of the stages of a view and its gradient, and the renderer that drew it."""
    renderer = SplatRenderer(gaussians, scene.width, scene.height, threads=threads)
    camera = scene.camera()
    rng = np.random.default_rng(1)
    renderer.adj_image.assign(rng.normal(size=(scene.height, scene.width, 3)))
    renderer.forward(camera, near=NEAR)
    renderer.backward()
    clock, stages = clock_for(threads), renderer.stages().items()
    return {name: best_ms(stage, repeats, clock=clock) for name, stage in stages}, renderer


@dataclass(frozen=True)
class Work:
    """What the raster kernels have to do for one view.

    Attributes:
        rows: (tile, splat, row) triples.
        pixels: pixels evaluated: the blocks that the splat touches, times their pixels.
    """

    rows: int
    pixels: int


def count_work(renderer: SplatRenderer) -> Work:
    """Count the work of the last view of a renderer, were no pixel saturated."""
    lists, binner = renderer.binner.lists, renderer.binner
    starts = np.array(lists.tile_starts.numpy(), dtype=np.int64)[: binner.tiles + 1]
    members = np.array(lists.pairs.numpy(), dtype=np.int64)[: binner.total_pairs, 0]
    splats = np.array(lists.splats.numpy(), dtype=np.float64)[members]
    tiles = np.repeat(np.arange(binner.tiles), np.diff(starts))
    corners = np.stack([tiles % binner.columns, tiles // binner.columns], axis=1) * TILE_SIZE
    centers = splats[:, [SPLAT_U, SPLAT_V]] - corners - 0.5
    halves = splats[:, [SPLAT_HALF_WIDTH, SPLAT_HALF_HEIGHT]]
    first = np.maximum(np.ceil(centers - halves), 0)
    last = np.minimum(np.floor(centers + halves), TILE_SIZE - 1)
    rows = np.maximum(last[:, 1] - first[:, 1] + 1, 0)
    size = np.array([BLOCK_WIDTH, BLOCK_HEIGHT])
    blocks = np.maximum(last // size - first // size + 1, 0).prod(axis=1)
    return Work(int(rows.sum()), int(blocks.sum()) * BLOCK_WIDTH * BLOCK_HEIGHT)


def _rates(
    renderer: SplatRenderer, times: dict[str, float], threads: int, matrix_rate: float
) -> dict[str, float]:
    """Return row evaluations per second and core, and the share of the matrix product's rate."""
    work = count_work(renderer)
    found = {}
    for stage, operations in (("forward", FORWARD_FLOPS), ("backward", BACKWARD_FLOPS)):
        seconds = 1e-3 * times[stage] * threads
        found[f"{stage} [M rows/s/core]"] = work.rows / seconds / 1e6
        rate = operations * work.pixels / seconds
        found[f"{stage} [% of matrix product]"] = 100 * rate / matrix_rate
    return found


def measure_matrix_product(size: int = 1024) -> float:
    """Return the operations per second of a float32 matrix product on one core."""
    a = np.random.default_rng(0).normal(size=(size, size)).astype(np.float32)
    # CPU time of all threads of the library: seconds of one core.
    return 2e3 * size**3 / best_ms(lambda: np.dot(a, a), 5, clock=time.process_time)
