"""How far a sensor's confidence can be trusted: the reliability tables and charts of `bench realism`.

The full search has two kinds of confidence: that of its tier, from the costs of its matches, and the one that
its own code offers: by which margin a match beats its best rival (StereoSGBM's uniqueness ratio).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.sim.config import Tier
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.matcher import UNIQUENESS, match, search_range
from digs_warp.study.charts import Chart, Curve
from digs_warp.study.realism_scenes import Scene
from digs_warp.study.realism_scores import reliability
from digs_warp.study.results import Result

TIERS: tuple[Tier, ...] = ("guided", "matcher")
MARGIN = "matcher, by its margin"

EDGES = (0.0, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0)
MARGINS = (UNIQUENESS, 15, 20, 30, 50, 100)  # [%]; nothing is more unique than the last

KEPT_ASIDE = "wrong, scenes kept aside"


@dataclass(frozen=True, eq=False)
class Matches:
    """What a sensor matched on some scenes.

    Attributes:
        confidence: of each match, or another measure of how far to trust it, (n,).
        right: which are within a pixel of the truth, (n,), bool.
        aside: which are of scenes that were kept aside, (n,), bool.
    """

    confidence: np.ndarray
    right: np.ndarray
    aside: np.ndarray


def confidence_results(scenes: Sequence[Scene]) -> Iterator[Result]:
    """Yield what share of the matches is wrong at each confidence, over all scenes; the last row has all."""
    for tier in TIERS:
        yield from _range_results(tier, _matches(scenes, tier), EDGES, percent=False)
    yield from _range_results(MARGIN, _margins(scenes), MARGINS, percent=True)


def confidence_charts(results: Sequence[Result]) -> list[Chart]:
    """Return the reliability curves, and what is wrong among the most trusted matches."""
    rows = [r for r in results if r.table == "confidence"]
    return [_reliability_chart(rows), _trust_chart(rows)]


def _matches(scenes: Sequence[Scene], tier: Tier) -> Matches:
    parts = []
    for scene in scenes:
        sensed, true = scene.sense(tier), scene.truth.disparity
        known = sensed.known & np.isfinite(true)
        parts.append(_part(scene, sensed.disparity[known], true[known], sensed.confidence[known]))
    return _joined(parts)


def _margins(scenes: Sequence[Scene]) -> Matches:
    """Return the matches of the full search with the largest of MARGINS at which it keeps each."""
    parts = []
    for scene in scenes:
        rig, true = scene.truth.rig, scene.truth.disparity
        left, right = map(gray_of, scene.images())
        matched = scene.sense("matcher")
        margin = np.zeros(true.shape)
        for least in MARGINS[:-1]:
            kept = match(left, right, search_range(rig), rig.window, uniqueness=least)
            margin[np.isfinite(kept)] = least
        known = matched.known & np.isfinite(true)
        parts.append(_part(scene, matched.disparity[known], true[known], margin[known]))
    return _joined(parts)


def _part(scene: Scene, found: np.ndarray, true: np.ndarray, confidence: np.ndarray) -> Matches:
    right = np.abs(found - true) <= 1
    return Matches(confidence, right, np.full(len(right), not scene.tuned))


def _joined(parts: Sequence[Matches]) -> Matches:
    names = ("confidence", "right", "aside")
    return Matches(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def _range_results(
    sensor: str, matches: Matches, edges: Sequence[float], percent: bool
) -> Iterator[Result]:
    aside = matches.aside
    wrong_aside = {
        trust.low: 1 - trust.right
        for trust in reliability(matches.confidence[aside], matches.right[aside], edges)
    }
    some_tuned = not aside.all()
    for trust in reliability(matches.confidence, matches.right, edges):
        values = {"share of the matches": trust.count / len(aside)}
        if not percent:
            values["mean confidence"] = trust.confidence
        values["wrong"] = 1 - trust.right
        if some_tuned and trust.low in wrong_aside:
            values[KEPT_ASIDE] = wrong_aside[trust.low]
        unit = " %" if percent else ""
        label = f"{trust.low:g} to {trust.high:g}{unit}"
        yield Result({"sensor": sensor, "confidence": label}, values, "confidence")
    values = {"share of the matches": 1.0, "wrong": float(1 - matches.right.mean())}
    if not percent:
        values["mean confidence"] = float(matches.confidence.mean())
    if some_tuned and aside.any():
        values[KEPT_ASIDE] = float(1 - matches.right[aside].mean())
    yield Result({"sensor": sensor, "confidence": "all"}, values, "confidence")


def _ranges(rows: Sequence[Result], sensor: str) -> list[Result]:
    return [r for r in rows if r.labels["sensor"] == sensor and r.labels["confidence"] != "all"]


def _reliability_chart(rows: Sequence[Result]) -> Chart:
    curves = [Curve("as stated", [0, 1], [1, 0], marker=False, color=6)]
    for color, tier in enumerate(TIERS):
        mine = _ranges(rows, tier)
        stated = [r.values["mean confidence"] for r in mine]
        curves.append(Curve(tier, stated, [r.values["wrong"] for r in mine], color=color))
    aside = [r for r in _ranges(rows, "guided") if KEPT_ASIDE in r.values]
    if aside:
        stated = [r.values["mean confidence"] for r in aside]
        wrong = [r.values[KEPT_ASIDE] for r in aside]
        curves.append(Curve("guided, scenes kept aside", stated, wrong, line=False, color=4))
    return Chart(
        "realism_reliability",
        "Reliability: what is wrong at each confidence",
        curves,
        "confidence",
        "share of the matches that is wrong",
    )


def _trust_chart(rows: Sequence[Result]) -> Chart:
    """What is wrong among the matches that are kept when the least trusted ones are dropped."""
    curves = []
    for sensor in (*TIERS, MARGIN):
        mine = _ranges(rows, sensor)[::-1]
        shares = np.array([r.values["share of the matches"] for r in mine])
        wrong = np.cumsum(shares * [r.values["wrong"] for r in mine]) / np.cumsum(shares)
        curves.append(Curve(sensor, np.cumsum(shares).tolist(), wrong.tolist()))
    return Chart(
        "realism_trust",
        "Keeping only the most trusted matches",
        curves,
        "share of the matches that is kept",
        "share of these that is wrong",
    )
