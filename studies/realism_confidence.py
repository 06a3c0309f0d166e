"""`python -m studies confidence`: the constants of the confidence in matches, and how often they are right.

The constants are fitted to every other sample mesh at both widths, and tried on the meshes kept aside.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from digs_warp.checks import DigsError
from digs_warp.record.progress import progress
from digs_warp.sim.sensor.error_attribution import WRONG
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.guided.confidence import BASE, FLOOR, ODDS, confidence_of
from digs_warp.sim.sensor.guided.search import PATHS, search
from digs_warp.sim.sensor.matcher import search_range
from digs_warp.study.scenes import sample_data
from studies.realism import WIDTHS
from studies.realism_scenes import Scene, places
from studies.results import Result

PER_SCENE = 30_000  # matches, drawn
TRUSTED = (0.0, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0)  # ranges of confidence

# Cost, by how much the best rival costs more, whether it is right (1 or 0): a row for each match.
Matches = np.ndarray


def bench_confidence(data: Path | None = None, widths: Sequence[int] = WIDTHS) -> list[Result]:
    """Return the constants in use and those fitted here, and how often matches are right by confidence.

    Args:
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
        widths: of the rendered images [px].
    """
    chosen = [(width, place) for width in widths for place in places(data or sample_data())]
    drawn: dict[bool, list[Matches]] = {True: [], False: []}
    with progress(len(chosen), "Searching", "frame") as bar:
        for width, place in chosen:
            drawn[place.tuned].append(_matches(place.scene(width)))
            bar.update()
    if not drawn[True] or not drawn[False]:
        raise DigsError(
            f"{data or sample_data()}: {len(chosen)} frames of meshes, expected some to fit and some"
            " to try: meshes/*/*.glb; DIGS_WARP_SAMPLE_DATA names the folder"
        )
    fitted, aside = np.concatenate(drawn[True]), np.concatenate(drawn[False])
    used = BASE, ODDS, FLOOR
    return [
        *(
            _constants(name, each, fitted, aside)
            for name, each in (("used", used), ("fitted", fit(fitted)))
        ),
        *_calibration(used, fitted, aside),
    ]


def _matches(scene: Scene) -> Matches:
    """Return some of the matches of a scene that are within the range of the camera."""
    truth, rig = scene.truth, scene.truth.rig
    left, right = map(gray_of, scene.images())
    disparities = search_range(rig)
    found = search(left, right, truth.disparity, disparities, rig.window, smoothness=rig.smoothness)
    sure = confidence_of(left, found.disparity, found.cost, found.rival, rig.window)
    is_far = found.disparity < rig.focal_baseline / rig.max_depth
    known = np.flatnonzero((sure > 0) & ~is_far & np.isfinite(truth.disparity))
    at = np.random.default_rng(0).choice(known, PER_SCENE)
    summed = PATHS * rig.window**2
    is_right = np.abs(found.disparity - truth.disparity) <= WRONG
    columns = found.cost / summed, (found.rival - found.cost) / summed, is_right
    return np.stack([each.reshape(-1)[at] for each in columns], axis=1)


def probability(constants: Sequence[float], matches: Matches) -> np.ndarray:
    """Return the confidence in matches, see `digs_warp.sim.sensor.guided.confidence`."""
    base, factor, floor = constants
    odds = base + factor * matches[:, 1] / (matches[:, 0] + floor) ** 2.5
    return odds / (1 + odds)


def loss(constants: Sequence[float], matches: Matches) -> float:
    """Return the mean of the negative logarithm of what was said of what happened."""
    said = probability(constants, matches)
    return -float(np.log(np.where(matches[:, 2] > 0.5, said, 1 - said)).mean())


def fit(matches: Matches) -> tuple[float, ...]:
    """Return base, factor and floor of the odds, by maximum likelihood."""
    start = np.log([BASE, ODDS, FLOOR])
    found = minimize(lambda x: loss(np.exp(x), matches), start, method="Nelder-Mead")
    return tuple(map(float, np.exp(found.x)))


def _constants(name: str, constants: Sequence[float], fitted: Matches, aside: Matches) -> Result:
    values: dict[str, float] = dict(zip(("BASE", "ODDS", "FLOOR"), constants, strict=True))
    for where, matches in (("", fitted), (", kept aside", aside)):
        values[f"loss{where}"] = loss(constants, matches)
        said = probability(constants, matches)
        values[f"right - said{where}"] = float((matches[:, 2] - said).mean())
    return Result({"constants": name}, values, "constants")


def _calibration(constants: Sequence[float], fitted: Matches, aside: Matches) -> Iterator[Result]:
    for low, high in pairwise(TRUSTED):
        values = {}
        for where, matches in (("", fitted), (", kept aside", aside)):
            said = probability(constants, matches)
            here = (said >= low) & (said < high)
            values[f"matches{where}"] = float(here.mean())
            values[f"right{where}"] = float(matches[here, 2].mean())
        yield Result({"confidence": f"{low:g} to {high:g}"}, values, "confidence")
