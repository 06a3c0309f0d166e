"""`python -m studies sim`: time and realism of each tier of the simulated depth sensor.

Every tier senses frames of sample meshes, or of the built-in object where there is no sample data, and a
real pair with true disparity. The matcher is the yardstick: it searches the full range and is told
nothing. The table shows the time and the errors of each tier.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from digs_warp.record.progress import progress
from digs_warp.sim.config import Tier
from digs_warp.sim.record.record import frames_at_once
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.facts import measure_facts
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.planner import plan
from digs_warp.sim.sensor.tiers import sense
from digs_warp.study.scenes import sample_data
from studies.real_pair import load_motorcycle
from studies.realism_scenes import Place
from studies.results import Result
from studies.stereo_scores import Scores, score
from studies.timing import ms_side_by_side

MESHES = (
    *("painted_stool", "flight_helmet", "wooden_bookshelf", "ycb_cracker_box"),
    "water_bottle_clear",
)
ENVIRONMENT = "st_fagans_interior"
REAL_PAIR = "rgbd/middlebury_motorcycle"

WIDTH = 1280
FRAMES = 7  # of the walk; the third one is taken: from half above

ROUNDS = 5
TIERS: tuple[Tier, ...] = ("truth", "law", "guided", "matcher")

TIME = "time [ms/MP]"

# Scores in the tables and their headings.
COLUMNS = {
    **{"fill": "fill", "bad_1": "bad-1", "rms": "rms [px]"},
    **{"edge_bad_1": "edge bad-1", "occluded_holes": "occluded holes"},
}


@dataclass(frozen=True, eq=False)
class Case:
    """A frame to be sensed over and over.

    Attributes:
        name: of the scene.
        fresh: returns the frame with nothing computed yet, so that every sensor pays for what it needs.
        choices: the plan.
        recorded: the two images with the noise of the camera; None: the images have their own.
    """

    name: str
    fresh: Callable[[], FrameTruth]
    choices: tuple[Choice, ...]
    recorded: tuple[np.ndarray, np.ndarray] | None = None

    def sense(self, tier: Tier) -> np.ndarray:
        """Return the disparity that a tier reports."""
        return sense(self.fresh(), tier, self.choices, recorded=self.recorded).disparity


def bench_sim(
    data: Path | None = None,
    meshes: Sequence[str] = MESHES,
    width: int = WIDTH,
) -> list[Result]:
    """Return times and scores of the tiers on every scene.

    Args:
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
        meshes: names of sample meshes.
        width: of the rendered images [px].
    """
    data = data or sample_data()
    results: list[Result] = []
    environment = data / "envs" / ENVIRONMENT / f"{ENVIRONMENT}_1k.hdr"
    files = [data / "meshes" / mesh / f"{mesh}.glb" for mesh in meshes]
    scenes = [Place(file, environment) for file in files if file.is_file()]
    cases = [_rendered(place, width) for place in scenes or [Place()]]
    with progress(len(cases), "Measuring", "scene") as bar:
        for case in cases:
            results += _tier_results(case)
            bar.update()
    if (data / REAL_PAIR).is_dir():
        results += _tier_results(_real(data / REAL_PAIR))
    return results


def _rendered(place: Place, width: int) -> Case:
    """Return a rendered frame."""
    scene = place.scene(width, FRAMES // 2, FRAMES)
    choices = plan(scene.facts, scene.truth.rig)
    return Case(scene.name, scene.fresh, choices, scene.images())


def _real(folder: Path) -> Case:
    """Return the real pair; what its right eye sees is known, not cast, and costs nothing."""
    truth = load_motorcycle(folder)
    truth.rays.right_visibility(np.ones(truth.depth.shape, bool), truth.depth)
    choices = plan(measure_facts([truth], truth.rig), truth.rig)
    return Case("motorcycle (real)", lambda: replace(truth), choices)


def _tier_results(case: Case) -> Iterator[Result]:
    truth = case.fresh()
    megapixels = truth.depth.size / 1e6
    for tier in TIERS:
        wall, cpu = _timed(lambda tier=tier: case.sense(tier))
        values = {TIME: wall / megapixels, "CPU [ms/MP]": cpu / megapixels}
        values |= _columns(score(case.sense(tier), truth))
        yield Result({"scene": case.name, "sensor": tier}, values, "tiers")


def _columns(scores: Scores) -> dict[str, float]:
    return {label: getattr(scores, name) for name, label in COLUMNS.items()}


def _timed(function: Callable[[], object]) -> tuple[float, float]:
    """Return wall and CPU time per call of as many at once as a recording makes [ms]: users wait for that."""
    return ms_side_by_side(function, frames_at_once(), ROUNDS)
