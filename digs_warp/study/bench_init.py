"""`digs-warp bench init`: from 200 depth maps of 2208x1242 to points: seconds, memory, distances.

A few views of the built-in object are rendered and sensed (not timed) and held in memory; each serves many
times, so that reading files does not count. The scale is estimated from sparse points made from the truth.
Times are wall-clock for a stage of the recipe, and CPU time for its parts, all threads together.
"""

import gc
import os
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from digs_warp.data.capture import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.sfm_model import SfmModel
from digs_warp.device.parallel import default_threads
from digs_warp.init.config import InitConfig, Strategy
from digs_warp.init.local_scales import local_scales
from digs_warp.init.recipes import initialize
from digs_warp.init.scale import estimate_scale
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.init_cases import InitCase, render_case
from digs_warp.study.results import Result
from digs_warp.study.synthetic_sfm import sfm_from_truth

WIDTH, HEIGHT = 2208, 1242
FRAMES = 200
DISTINCT = 8
SFM_PER_METRE = 1.37

MEMORY_INTERVAL = 0.02  # seconds between two looks at the memory in use
STRATEGIES: tuple[Strategy, ...] = ("highdepth", "depth", "fusion")


def in_memory(frame: Frame) -> Frame:
    """Return the frame with the layers that initialization reads as arrays."""
    return replace(
        frame,
        layers={
            Layer.IMAGE: frame.load_image(),
            Layer.DEPTH: frame.load_depth(),
            Layer.MASK: frame.load_mask(),
        },
    )


class PeakMemory:
    """The most memory that the process has in use between entering and leaving [bytes].

    Attributes:
        start: in use when entered.
        peak: the most that was seen.
    """

    def __init__(self) -> None:
        self.start = self.peak = 0
        self._done = threading.Event()

    @contextmanager
    def watch(self) -> Iterator["PeakMemory"]:
        """Look at the memory in use every few milliseconds until the block is left."""
        gc.collect()
        self.start = self.peak = _resident()
        watcher = threading.Thread(target=self._look, daemon=True)
        watcher.start()
        try:
            yield self
        finally:
            self._done.set()
            watcher.join()

    def _look(self) -> None:
        while not self._done.wait(MEMORY_INTERVAL):
            self.peak = max(self.peak, _resident())


def bench_init(
    width: int = WIDTH, height: int = HEIGHT, frames: int = FRAMES, distinct: int = DISTINCT
) -> list[Result]:
    """Return times [s], memory [GB] and distance to the true surface [mm] of scale and strategies.

    Args:
        width: of the depth maps [px].
        height: of the depth maps [px].
        frames: number of frames that are initialized from.
        distinct: number of different ones among them, each used alike often.
    """
    config = SimulateConfig(frames=distinct, width=width, height=height, samples_per_pixel=1)
    with tempfile.TemporaryDirectory() as folder:
        case = render_case(config, Path(folder))
        capture = case.capture()
        sfm = sfm_from_truth(capture.frames, SFM_PER_METRE)
        held = [in_memory(frame) for frame in capture.frames]
    names = [f"{number:04d}" for number in range(frames)]
    many = [replace(held[i % distinct], name=name) for i, name in enumerate(names)]
    shared = {"frames": frames, "size": f"{width}x{height}", "threads": default_threads()}
    initialize(many[:distinct], InitConfig())  # compiles the kernels
    start = time.perf_counter()
    scale = estimate_scale(local_scales(sfm, held, InitConfig()))
    results = [
        Result(f"scale from {distinct} frames", time.perf_counter() - start, "s"),
        Result("scale error", abs(scale.sfm_per_metre / SFM_PER_METRE - 1), "share"),
    ]
    metric = sfm.in_metres(scale.sfm_per_metre)
    for strategy in STRATEGIES:
        results += _measure(case, many, replace(InitConfig(), strategy=strategy), metric)
    return [replace(result, settings=shared | result.settings) for result in results]


def _measure(
    case: InitCase, frames: Sequence[Frame], config: InitConfig, metric: SfmModel
) -> Iterator[Result]:
    """Return what one strategy costs and gives."""
    settings = {"strategy": config.strategy}
    memory = PeakMemory()
    start = time.perf_counter()
    with memory.watch():
        found = initialize(frames, config, metric)
    yield Result("wall clock", time.perf_counter() - start, "s", settings)
    assert found.depth is not None
    for stage, seconds in found.depth.seconds.items():
        if stage != "read":
            yield Result(f"CPU: {stage}", seconds, "s", settings)
    yield Result("peak memory", memory.peak / 1e9, "GB", settings)
    yield Result("of it the stage's own", (memory.peak - memory.start) / 1e9, "GB", settings)
    score = case.score(found.points.points_world)
    yield Result("points", len(found.points), "points", settings)
    yield Result("Chamfer distance", 1e3 * score.chamfer, "mm", settings)
    yield Result("median distance to the surface", 1e3 * score.accuracy_median, "mm", settings)


def _resident() -> int:
    """Return the memory that the process has in use [bytes]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")
