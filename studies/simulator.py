"""`python -m studies sim`: time and errors of each tier of the simulated depth sensor.

Every tier senses a frame of the built-in object, and a real pair with true disparity where the sample data is
there. The matcher is the yardstick: it searches the full range and is told nothing.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.sim.config import Tier
from digs_warp.sim.sensor.facts import measure_facts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.planner import plan
from digs_warp.sim.sensor.tiers import sense
from digs_warp.study.scenes import sample_data
from studies.real_pair import load_motorcycle
from studies.realism_scenes import Place
from studies.results import Result
from studies.stereo_scores import score
from studies.timing import best_ms

REAL_PAIR = "rgbd/middlebury_motorcycle"
WIDTH = 1280
ROUNDS = 5
TIERS: tuple[Tier, ...] = ("truth", "law", "guided", "matcher")
TIME = "CPU [ms/MP]"

# Scores in the tables and their headings.
COLUMNS = {
    **{"fill": "fill", "bad_1": "bad-1", "rms": "rms [px]"},
    **{"edge_bad_1": "edge bad-1", "occluded_holes": "occluded holes"},
}


def bench_sim(data: Path | None = None, width: int = WIDTH) -> list[Result]:
    """Return times and scores of the tiers on both scenes.

    Args:
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
        width: of the rendered images [px].
    """
    scene = Place().scene(width)
    choices, images = plan(scene.facts, scene.truth.rig), scene.images()
    results = [
        *_tiers(
            "built-in",
            scene.fresh,
            lambda truth, tier: sense(truth, tier, choices, recorded=images),
        )
    ]
    folder = (data or sample_data()) / REAL_PAIR
    if folder.is_dir():
        pair = load_motorcycle(folder)
        # What its right eye sees is known, not cast, and costs nothing.
        pair.rays.right_visibility(np.ones(pair.depth.shape, bool), pair.depth)
        real = plan(measure_facts([pair], pair.rig), pair.rig)
        results += _tiers(
            "motorcycle (real)", lambda: replace(pair), lambda truth, tier: sense(truth, tier, real)
        )
    return results


def _tiers(
    name: str, fresh: Callable[[], FrameTruth], sensed: Callable[[FrameTruth, Tier], Sensed]
) -> Iterator[Result]:
    """Yield a row for each tier; ``fresh`` gives the frame with nothing computed yet."""
    truth = fresh()
    for tier in TIERS:
        ms = best_ms(lambda tier=tier: sensed(fresh(), tier), ROUNDS, clock=time.process_time)
        scores = score(sensed(fresh(), tier).disparity, truth)
        values = {label: getattr(scores, key) for key, label in COLUMNS.items()}
        time_taken = {TIME: ms / (truth.depth.size / 1e6)}
        yield Result({"scene": name, "sensor": tier}, time_taken | values, "tiers")
