"""`digs-warp bench init`: 200 depth maps of 2208x1242 to points: seconds, memory, distance to the truth.

A few views of the built-in object are rendered and sensed (not timed), held in memory and used many times, so
that reading files does not count. The scale is estimated from sparse points that are made from the truth.
"CPU" times sum over all threads.
"""

import gc
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.sfm_model import SfmModel
from digs_warp.device.parallel import default_threads
from digs_warp.init.config import InitConfig
from digs_warp.init.local_scales import local_scales
from digs_warp.init.recipes import initialize
from digs_warp.init.scale import estimate_scale
from digs_warp.init.strategies import StrategyName
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.init_cases import InitCase, render_case
from digs_warp.study.results import Result
from digs_warp.study.scenes import VOXEL, voxel_size
from digs_warp.study.synthetic_sfm import sfm_from_truth
from digs_warp.study.timing import Stopwatch, peak_memory

WIDTH, HEIGHT = 2208, 1242
FRAMES = 200
DISTINCT = 8
SFM_PER_METRE = 1.37

STRATEGIES: tuple[StrategyName, ...] = ("highdepth", "depth", "fusion")


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


def bench_init(
    width: int = WIDTH, height: int = HEIGHT, frames: int = FRAMES, distinct: int = DISTINCT
) -> list[Result]:
    """Return time and error of the scale; time, memory and distance to the true surface by strategy.

    Args:
        width: of the depth maps [px].
        height: of the depth maps [px].
        frames: number of frames that are initialized from.
        distinct: number of different ones among them, each used equally often.
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
    initialize(many[:distinct], InitConfig(voxel_size=VOXEL))  # compiles the kernels
    with Stopwatch() as watch:
        scale = estimate_scale(local_scales(sfm, held, InitConfig()))
    values = {
        f"scale from {distinct} frames [s]": watch.seconds,
        "scale error": abs(scale.sfm_per_metre / SFM_PER_METRE - 1),
    }
    results = [Result(shared, values, "scale")]
    metric = sfm.in_metres(scale.sfm_per_metre)
    for strategy in STRATEGIES:
        config = InitConfig(strategy=strategy, voxel_size=voxel_size(strategy))
        values = _measure(case, many, config, metric)
        results.append(Result(shared | {"strategy": strategy}, values, "strategies"))
    return results


def _measure(
    case: InitCase, frames: Sequence[Frame], config: InitConfig, metric: SfmModel
) -> dict[str, float]:
    """Return the costs and the accuracy of one strategy."""
    gc.collect()
    with peak_memory() as memory, Stopwatch() as watch:
        found = initialize(frames, config, metric)
    assert found.depth is not None
    score = case.score(found.points.points_world)
    stages = found.depth.seconds.items()
    return {
        "wall clock [s]": watch.seconds,
        **{f"CPU: {stage} [s]": seconds for stage, seconds in stages if stage != "read"},
        "peak memory [GB]": memory.peak / 1e9,
        "growth [GB]": memory.growth / 1e9,
        "points": len(found.points),
        "Chamfer [mm]": 1e3 * score.chamfer,
        "median to surface [mm]": 1e3 * score.accuracy_median,
    }
