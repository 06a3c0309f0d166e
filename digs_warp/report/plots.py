"""Charts as inline SVG. Text and axes take the page's text color, so they fit light and dark pages."""

import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

# Placeholder for the page's text color inside matplotlib; no chart uses it for anything else.
_INK = "#010203"
COLORS = ("#2f7ed8", "#e07b20", "#159a84", "#b04fc4", "#c8423b")
_SIZE = (5.2, 3.1)  # inches; the page scales it


@dataclass(frozen=True)
class Line:
    """One curve: a label for the legend, and points."""

    label: str
    x: Sequence[float]
    y: Sequence[float]
    marker: bool = False


@dataclass(frozen=True)
class Bar:
    """One horizontal bar; bars of a group share a color."""

    label: str
    value: float
    group: str


def line_chart(lines: Sequence[Line], x_label: str, y_label: str, log_y: bool = False) -> str:
    """Return an SVG element with the curves and, for several, a legend."""
    from matplotlib.ticker import LogLocator, NullFormatter

    def draw(axes: Any) -> None:
        for line, color in zip(lines, COLORS, strict=False):
            marker = {"marker": "o", "markersize": 4.5} if line.marker else {}
            axes.plot(line.x, line.y, label=line.label, color=color, linewidth=1.8, **marker)
        axes.set_xlabel(x_label)
        axes.set_ylabel(y_label)
        if log_y:
            axes.set_yscale("log")
            axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.yaxis.set_major_formatter("{x:g}")
            axes.yaxis.set_minor_formatter(NullFormatter())
        axes.margins(x=0.02, y=0.08)
        if len(lines) > 1:
            axes.legend(frameon=False, loc="best")

    return _svg(draw, _SIZE)


def bar_chart(bars: Sequence[Bar], x_label: str) -> str:
    """Return an SVG element with one labeled horizontal bar each, top to bottom."""
    groups = list(dict.fromkeys(bar.group for bar in bars))

    def draw(axes: Any) -> None:
        rows = range(len(bars))
        values = [bar.value for bar in bars]
        colors = [COLORS[groups.index(bar.group) % len(COLORS)] for bar in bars]
        drawn = axes.barh(rows, values, color=colors, height=0.65)
        axes.bar_label(drawn, labels=[f"{value:.1f}" for value in values], padding=4)
        axes.set_yticks(rows, [bar.label for bar in bars])
        axes.invert_yaxis()
        axes.grid(axis="y", visible=False)
        axes.set_xlabel(x_label)
        axes.margins(x=0.1)

    return _svg(draw, (6.4, 0.75 + 0.3 * len(bars)))


def _svg(draw: Callable[[Any], None], size: tuple[float, float]) -> str:
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with _style():
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasSVG(figure)
        draw(figure.subplots())
        buffer = io.StringIO()
        # No date: the same results give the same page.
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    svg = buffer.getvalue()
    return svg[svg.index("<svg") :].replace(_INK, "currentColor")


@contextmanager
def _style() -> Iterator[None]:
    import matplotlib

    with matplotlib.rc_context(
        {
            "svg.fonttype": "none",  # text stays text
            "svg.hashsalt": "digs-warp",
            "font.family": "sans-serif",
            "font.size": 10.0,
            "text.parse_math": False,  # a dollar sign in a name is a dollar sign
            "text.color": _INK,
            "axes.labelcolor": _INK,
            "axes.edgecolor": _INK,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.grid": True,
            "grid.color": _INK,
            "grid.alpha": 0.15,
            "xtick.color": _INK,
            "ytick.color": _INK,
            "legend.labelcolor": _INK,
        }
    ):
        yield
