"""The picture of `digs-warp bench scaling`: measured times, and the law that is fitted to them."""

import io
from collections.abc import Sequence
from typing import Any

from digs_warp.study.results import Result

LABELS = {
    "pixels": "pixels of the image (and size of the splats)",
    "splats": "splats",
    "overlap": "overlap: size of the splats, relative",
    "threads": "threads",
}
COLORS = {"raster": "tab:blue", "per splat": "tab:orange"}


def plot_scaling(results: Sequence[Result]) -> bytes:
    """Return a PNG with one panel per curve; lines are the law, points the measurements."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 3.8), layout="constrained")
    measured = {r.settings.get("curve") for r in results}
    curves = [curve for curve in LABELS if curve in measured]
    panels = figure.subplots(1, len(curves), squeeze=False)[0]
    for axes, curve in zip(panels, curves, strict=True):
        _draw_curve(axes, curve, results)
    panels[0].set_ylabel("time of forward and backward [ms]")
    panels[0].legend(title="points: measured, lines: law")
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=110)
    return file.getvalue()


def _draw_curve(axes: Any, curve: str, results: Sequence[Result]) -> None:
    for name, color in COLORS.items():
        points = [r for r in results if r.name == name and r.settings.get("curve") == curve]
        points.sort(key=lambda r: r.settings["at"])
        at = [r.settings["at"] for r in points]
        axes.plot(at, [r.value for r in points], "o", color=color, label=name)
        law = [_law(name, results, r) / r.settings["threads"] for r in points]
        axes.plot(at, law, "-", color=color, linewidth=1)
    axes.set_xlabel(LABELS[curve])
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    axes.grid(visible=True, which="both", alpha=0.25)


def _law(name: str, results: Sequence[Result], point: Result) -> float:
    """Return the law's time of a point [ms] on one thread."""
    laws = [r for r in results if r.name == f"{name} law"]
    return 1e-6 * sum(r.value * point.settings[r.settings["per"]] for r in laws)
