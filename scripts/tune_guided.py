"""Fit the constants of the default sensor to matching over the full range: its uniqueness and its confidence.

Usage: python scripts/tune_guided.py   (a minute or two; needs the sample data)

Every other sample mesh is fitted; the others are kept aside, and the same figures are printed for them. The
constants are UNIQUENESS in sim/sensor/guided/search.py; BASE, ODDS and FLOOR in confidence.py beside it.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.record.progress import progress, show_progress
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.frame import Sensed
from digs_warp.sim.sensor.guided import search as guided
from digs_warp.sim.sensor.guided.confidence import BASE, FLOOR, ODDS
from digs_warp.sim.sensor.law import within_range
from digs_warp.sim.sensor.matcher import search_range
from digs_warp.study.realism_scenes import Scene, places
from digs_warp.study.realism_scores import agreement, bad_share
from digs_warp.study.results import Result, format_tables
from digs_warp.study.scenes import sample_data

WIDTH = 640
THRESHOLDS = range(10, 17)  # of uniqueness [%]
FLOORS = (0.125, 0.25, 0.5, 1.0)
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

    def odds(self, base: float, factor: float, floor: float) -> np.ndarray:
        """Return the odds of `confidence_of` with these constants."""
        gap = np.maximum(self.rival - self.cost, 0)
        return base + factor * gap / (self.cost + floor) ** 2.5


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


def confidence_results(matches: Sequence[Matches], name: str, fit: bool) -> Iterator[Result]:
    """Yield the constants that fit best for each floor, if asked for; then how well those in use fit."""
    joined = Matches(*(np.concatenate([getattr(m, k) for m in matches]) for k in vars(matches[0])))
    for floor in FLOORS if fit else ():
        yield _fit_result(name, (*fitted_constants(joined, floor), floor), joined, "fitted")
    yield _fit_result(name, (BASE, ODDS, FLOOR), joined, "in use")


def fitted_constants(matches: Matches, floor: float) -> tuple[float, float]:
    """Return the base and the factor of the odds under which the matches are most likely, both > 0."""
    from scipy.optimize import minimize

    def loss(logs: np.ndarray) -> float:
        base, factor = np.exp(logs)
        return _log_loss(matches.odds(base, factor, floor), matches.right)

    start = np.log([BASE, ODDS])
    found = minimize(loss, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-7})
    base, factor = np.exp(found.x).tolist()
    return base, factor


def _log_loss(odds: np.ndarray, right: np.ndarray) -> float:
    """Return the mean of -log(probability) of what happened."""
    return float(np.log1p(np.where(right, 1 / np.maximum(odds, 1e-9), odds)).mean())


def _fit_result(
    name: str, constants: tuple[float, float, float], joined: Matches, how: str
) -> Result:
    odds = joined.odds(*constants)
    confidence = odds / (1 + odds)
    place = np.digitize(confidence, RANGES)
    gaps = [abs((confidence - joined.right)[place == k].sum()) for k in range(1, len(RANGES) + 1)]
    base, factor, floor = constants
    return Result(
        {"scenes": name, "floor": floor, "constants": how},
        {
            "base": base,
            "odds": factor,
            "log loss": _log_loss(odds, joined.right),
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
            results += confidence_results([matches_of(s) for s in part], name, fit=tuned)
    sys.stdout.write(format_tables(results) + "\n")


if __name__ == "__main__":
    if sys.argv[1:]:
        sys.exit(__doc__)
    main()
