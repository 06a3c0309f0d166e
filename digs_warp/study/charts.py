"""Charts of studies, as PNG."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

# Color-blind safe (Okabe and Ito).
COLORS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9", "#7f7f7f", "#000000")
# Curves differ in more than their color, and one that lies over another shows it between its dashes.
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
DASHES = ("-", "--")

# A note stands to the upper left, which is free at points that nothing beats, and slanted, so that neighbors
# do not overlap.
_ABOVE = {
    **{"xytext": (0, 4), "textcoords": "offset points", "ha": "right"},
    **{"rotation": -40, "rotation_mode": "anchor"},
}


@dataclass(frozen=True)
class Curve:
    """One line of a chart.

    Attributes:
        label: for the legend.
        x, y: its points.
        spread: half width of a band around it; empty: none.
        line: whether its points are joined.
        notes: a word at each point; empty: none.
    """

    label: str
    x: Sequence[float]
    y: Sequence[float]
    spread: Sequence[float] = ()
    line: bool = True
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Chart:
    """Curves over common axes.

    Attributes:
        name: of its files, without suffix.
        title: stands above it.
        log_x: whether its axis is logarithmic.
    """

    name: str
    title: str
    curves: Sequence[Curve]
    x_label: str
    y_label: str
    log_x: bool = False

    def png(self) -> bytes:
        """Return the picture as PNG."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(7.2, 4.4), layout="constrained")
        axes = figure.subplots()
        axes.set(title=self.title, xlabel=self.x_label, ylabel=self.y_label)
        axes.grid(alpha=0.3)
        for number, curve in enumerate(self.curves):
            _draw(axes, curve, number)
        if any(curve.notes for curve in self.curves):
            axes.margins(x=0.18, y=0.25)
        if self.log_x:
            from matplotlib.ticker import LogLocator, NullFormatter

            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter(NullFormatter())
        if len(self.curves) > 1:
            axes.legend(frameon=False, fontsize=8)
        file = io.BytesIO()
        figure.savefig(file, format="png", dpi=120)
        return file.getvalue()


def _draw(axes: Any, curve: Curve, number: int) -> None:
    color, marker = COLORS[number % len(COLORS)], MARKERS[number % len(MARKERS)]
    dashes = DASHES[number % len(DASHES)] if curve.line else "none"
    style = {"color": color, "marker": marker, "linestyle": dashes, "markersize": 5}
    # Dashes lie on top.
    axes.plot(curve.x, curve.y, label=curve.label, zorder=2 + number % len(DASHES), **style)
    if curve.spread:
        y, spread = np.array(curve.y), np.array(curve.spread)
        axes.fill_between(curve.x, y - spread, y + spread, color=color, alpha=0.15, linewidth=0)
    for x, y, note in zip(curve.x, curve.y, curve.notes, strict=False):
        axes.annotate(note, (x, y), fontsize=7, **_ABOVE)
