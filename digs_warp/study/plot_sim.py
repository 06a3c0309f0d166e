"""The picture of `digs-warp bench sim`: what accuracy costs in time."""

import io
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from digs_warp.study.results import Result

TIME, ALONE = "time [ms/MP]", "alone [ms/MP]"
SHARES = ("fill", "bad-1", "edge bad-1", "occluded holes")
YARDSTICK = "matcher"


def plot_sim(results: Sequence[Result]) -> bytes:
    """Return a PNG: tiers by time and distance to the matcher; effects by time and by what they gain."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 5.2), layout="constrained")
    tiers_axes, effects_axes = figure.subplots(1, 2)
    _draw_tiers(tiers_axes, results)
    _draw_effects(effects_axes, results)
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=110)
    return file.getvalue()


def _draw_tiers(axes: Any, results: Sequence[Result]) -> None:
    scores: dict[tuple[str, str], dict[str, float]] = defaultdict(dict)
    for result in results:
        if "sensor" in result.settings:
            key = (result.settings["scene"], result.settings["sensor"])
            scores[key][result.name] = result.value
    for tier in dict.fromkeys(sensor for _, sensor in scores):
        rows = [
            (values, scores[scene, YARDSTICK])
            for (scene, sensor), values in scores.items()
            if sensor == tier
        ]
        times = [values[TIME] for values, _ in rows]
        gaps = [np.mean([abs(a[name] - b[name]) for name in SHARES]) for a, b in rows]
        axes.scatter(times, gaps, label=tier, alpha=0.8)
    axes.set_xscale("log")
    axes.set_xlabel("time of the sensor [ms per megapixel]")
    axes.set_ylabel("mean gap to the matcher in fill, bad-1,\nbad-1 at edges, holes where hidden")
    axes.set_title("Tiers: one point per scene")
    axes.grid(alpha=0.3)
    axes.legend()


def _draw_effects(axes: Any, results: Sequence[Result]) -> None:
    rows: dict[str, dict[str, float]] = defaultdict(dict)
    for result in results:
        if "effect" in result.settings:
            rows[result.settings["effect"]][result.name] = result.value
    names = sorted(rows, key=lambda name: rows[name][ALONE])
    places = np.arange(len(names))
    axes.barh(places, [rows[name][ALONE] for name in names], color="#b8c4d6")
    axes.set_yticks(places, names)
    axes.set_xlabel("time alone [ms per megapixel]")
    for place, name in enumerate(names):
        gains = [f"{label} {rows[name][f'nearer: {label}']:+.3f}" for label in SHARES]
        axes.annotate(
            ",  ".join(gains),
            (0, place),
            (4, 0),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
        )
    axes.set_title("Effects: time, and the gap to the matcher that each closes")
