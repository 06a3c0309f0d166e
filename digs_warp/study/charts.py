"""Charts of benchmarks and studies: the same drawing as PNG and SVG files, and inside a page."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

# Color-blind safe (Okabe and Ito).
COLORS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9", "#7f7f7f", "#000000")
# Curves differ in more than their color, and one that lies over another shows it between its dashes.
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
DASHES = ("-", "--")

# Of a logarithmic axis with this many values at most, the values are the ticks.
MOST_TICKS = 6

# Where a note stands. In rows to the right of its point; else to the upper left, which is free at points that
# nothing beats, and slanted, so that neighbors do not overlap.
_BESIDE = {"xytext": (6, -2), "textcoords": "offset points", "ha": "left"}
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
        line, marker: draw the line, the points; at least one of them.
        notes: a word at each point; empty: none.
        color: its number in COLORS, MARKERS and DASHES; None: the next one.
    """

    label: str
    x: Sequence[float]
    y: Sequence[float]
    spread: Sequence[float] = ()
    line: bool = True
    marker: bool = True
    notes: Sequence[str] = ()
    color: int | None = None


@dataclass(frozen=True)
class Chart:
    """Curves over common axes.

    Attributes:
        name: of its files, without suffix.
        title: stands above it.
        log_x, log_y: logarithmic axes.
        rows: names of the y values 0, 1, ..., the first at the top; empty: y is a number.
    """

    name: str
    title: str
    curves: Sequence[Curve]
    x_label: str
    y_label: str
    log_x: bool = False
    log_y: bool = False
    rows: Sequence[str] = ()

    def png(self) -> bytes:
        """Return the picture as PNG."""
        return side_by_side([self])

    def svg(self) -> bytes:
        """Return the picture as SVG; the same values give the same bytes."""
        return side_by_side([self], "svg")

    def draw(self, axes: Any) -> None:
        """Draw into the axes of a figure."""
        for number, curve in enumerate(self.curves):
            which = number if curve.color is None else curve.color
            color = COLORS[which % len(COLORS)]
            style = {
                "linestyle": DASHES[which % len(DASHES)] if curve.line else "none",
                "marker": MARKERS[which % len(MARKERS)] if curve.marker else "none",
                "zorder": 2 + which % len(DASHES),  # dashes lie on top
            }
            axes.plot(curve.x, curve.y, label=curve.label, color=color, markersize=5, **style)
            if curve.spread:
                low = [y - s for y, s in zip(curve.y, curve.spread, strict=True)]
                high = [y + s for y, s in zip(curve.y, curve.spread, strict=True)]
                axes.fill_between(curve.x, low, high, color=color, alpha=0.15, linewidth=0)
            for x, y, note in zip(curve.x, curve.y, curve.notes, strict=False):
                axes.annotate(note, (x, y), fontsize=7, **(_BESIDE if self.rows else _ABOVE))
        if any(curve.notes for curve in self.curves):
            axes.margins(x=0.18, y=0.05 if self.rows else 0.25)
            if self.rows:  # room for the notes to the right of the points
                ends = [x for curve in self.curves for x in curve.x]
                axes.set_xlim(0.0, 3.8 * max(ends))
        axes.set_title(self.title)
        axes.set_xlabel(self.x_label)
        axes.set_ylabel(self.y_label)
        self._scale(axes)
        if self.rows:
            axes.set_yticks(range(len(self.rows)), self.rows, fontsize=8)
            axes.set_ylim(len(self.rows) - 0.5, -0.5)
        axes.grid(alpha=0.3)
        if len(self.curves) > 1:
            axes.legend(frameon=False, fontsize=8)

    def _scale(self, axes: Any) -> None:
        from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter

        for wanted, set_scale, axis, values in (
            (self.log_x, axes.set_xscale, axes.xaxis, {x for c in self.curves for x in c.x}),
            (self.log_y, axes.set_yscale, axes.yaxis, {y for c in self.curves for y in c.y}),
        ):
            if wanted:
                set_scale("log")
                few = len(values) <= MOST_TICKS
                axis.set_major_locator(
                    FixedLocator(sorted(values)) if few else LogLocator(subs=(1.0, 2.0, 5.0))
                )
                axis.set_major_formatter("{x:g}")
                axis.set_minor_formatter(NullFormatter())


def side_by_side(charts: Sequence[Chart], form: str = "png") -> bytes:
    """Return charts as one picture, "png" or "svg"."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context({"svg.hashsalt": "digs-warp", "svg.fonttype": "none"}):
        figure = Figure(figsize=(7.2 * len(charts), 4.4), layout="constrained")
        for chart, axes in zip(
            charts, figure.subplots(1, len(charts), squeeze=False)[0], strict=True
        ):
            chart.draw(axes)
        file = io.BytesIO()
        metadata = {"Date": None} if form == "svg" else None
        figure.savefig(file, format=form, dpi=120, metadata=metadata)
    return file.getvalue()
