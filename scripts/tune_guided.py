"""Fit the constants of the default sensor to matching over the full range: its uniqueness and its confidence.

Usage: python scripts/tune_guided.py   (a minute or two; needs the sample data)

Every other sample mesh is fitted; the others are kept aside, and the same figures are printed for them. The
constants are UNIQUENESS in sim/sensor/guided/search.py, ODDS and FLOOR in sim/sensor/guided/confidence.py.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.record.progress import progress, show_progress
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.frame import Sensed
from digs_warp.sim.sensor.guided import search as guided
from digs_warp.sim.sensor.guided.confidence import FLOOR, ODDS
from digs_warp.sim.sensor.limit import within_range
from digs_warp.sim.sensor.matcher import search_range
from digs_warp.study.realism_scenes import Scene, places
from digs_warp.study.realism_scores import agreement, bad_share
from digs_warp.study.results import Result, format_tables
from digs_warp.study.scenes import sample_data

WIDTH = 640
THRESHOLDS = range(10, 17)  # of uniqueness [%]
FLOORS = (0.25, 0.5, 1.0)
RANGES = np.linspace(0, 1, 11)


@dataclass(frozen=True, eq=False)
class Matches:
    """The matches of a scene that are known to be right or wrong.

    Attributes:
        cost, rival: see `guided.Found`, (n,).
        right: whether they are within a pixel of the truth, (n,), bool.
    """

    cost: np.ndarray
    rival: np.ndarray
    right: np.ndarray

    def odds_per_constant(self, floor: float) -> np.ndarray:
        """Return the odds of `confidence_of` where its constant is 1."""
        return np.sqrt(np.maximum(self.rival - self.cost, 1e-6)) / np.square(self.cost + floor)


def find(scene: Scene, uniqueness: int = guided.UNIQUENESS) -> guided.Found:
    """Return what the default sensor finds with a threshold of uniqueness."""
    truth, rig = scene.truth, scene.truth.rig
    left, right = map(gray_of, scene.images())
    disparities = search_range(rig)
    found = guided.search(
        left, right, truth.disparity, disparities, rig.window, uniqueness=uniqueness
    )
    unlabeled = replace(Sensed.of(truth), disparity=found.disparity)
    return replace(found, disparity=within_range(unlabeled, rig).disparity)


def uniqueness_results(scenes: Sequence[Scene], name: str) -> Iterator[Result]:
    """Yield how near each threshold brings the sensor to the full search; means over scenes."""
    full = [scene.sense("matcher").disparity for scene in scenes]
    for threshold in THRESHOLDS:
        rows = []
        for scene, yardstick in zip(scenes, full, strict=True):
            found = find(scene, threshold).disparity
            true = scene.truth.disparity
            bad = [
                np.log(bad_share(found, true, part) / bad_share(yardstick, true, part))
                for part in (scene.mask, ~scene.mask)
            ]
            fill = np.isfinite(found).mean() - np.isfinite(yardstick).mean()
            rows.append([*bad, fill, *agreement(found, yardstick, true)])
        bad_object, bad_surround, fill, failures, rms = np.mean(rows, axis=0)
        yield Result(
            {"scenes": name, "uniqueness [%]": threshold},
            {
                "bad-1 / matcher's, object": float(np.exp(bad_object)),
                "bad-1 / matcher's, surround": float(np.exp(bad_surround)),
                "fill, difference": float(fill),
                "rank correlation of failures": float(failures),
                "of RMS": float(rms),
            },
            "uniqueness",
        )


def confidence_results(matches: Sequence[Matches], name: str) -> Iterator[Result]:
    """Yield the constant that fits best for each floor, and how well it fits; then the one in use."""
    joined = Matches(*(np.concatenate([getattr(m, k) for m in matches]) for k in vars(matches[0])))
    for floor in FLOORS:
        logs = np.log(joined.odds_per_constant(floor))
        yield _fit_result(name, floor, fitted_constant(logs, joined.right), joined, "fitted")
    yield _fit_result(name, FLOOR, ODDS, joined, "in use")


def fitted_constant(logs: np.ndarray, right: np.ndarray) -> float:
    """Return the factor on the odds that makes right matches as many as the odds say (maximum likelihood)."""
    low, high = -20.0, 20.0
    while high - low > 1e-6:
        middle = (low + high) / 2
        expected = (1 / (1 + np.exp(-middle - logs))).mean()
        low, high = (middle, high) if expected < right.mean() else (low, middle)
    return float(np.exp(low))


def _fit_result(name: str, floor: float, odds: float, joined: Matches, how: str) -> Result:
    values = odds * joined.odds_per_constant(floor)
    confidence = values / (1 + values)
    likelihood = np.where(joined.right, confidence, 1 - confidence)
    place = np.digitize(confidence, RANGES)
    gaps = [abs((confidence - joined.right)[place == k].sum()) for k in range(1, len(RANGES) + 1)]
    return Result(
        {"scenes": name, "floor": floor, "constant": how},
        {
            "odds": odds,
            "log loss": float(-np.log(likelihood).mean()),
            "mean gap of reliability": float(sum(gaps) / len(confidence)),
        },
        "confidence",
    )


def matches_of(scene: Scene) -> Matches:
    """Return the matches of the default sensor as it is."""
    found, true = find(scene), scene.truth.disparity
    known = np.isfinite(found.disparity) & np.isfinite(true)
    right = np.abs(found.disparity - true)[known] <= 1
    return Matches(found.cost[known].astype(float), found.rival[known].astype(float), right)


def main() -> None:
    """Print the tables."""
    show_progress()
    chosen = places(sample_data())
    scenes = []
    with progress(len(chosen), "Rendering", "scene") as bar:
        for place in chosen:
            scenes.append(place.scene(WIDTH))
            bar.update()
    results: list[Result] = []
    for tuned, name in ((True, "fitted"), (False, "kept aside")):
        part = [scene for scene in scenes if scene.tuned == tuned]
        if part:
            results += uniqueness_results(part, name)
            results += confidence_results([matches_of(scene) for scene in part], name)
    sys.stdout.write(format_tables(results) + "\n")


if __name__ == "__main__":
    main()
