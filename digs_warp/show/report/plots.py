"""Charts as inline SVG. Text and axes take the page's text color, so they fit light and dark pages."""

import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

# Placeholder for the page's text color inside matplotlib; no chart uses it for anything else.
_INK = "#010203"
COLORS = ("#2f7ed8", "#cf6c12", "#159a84", "#b04fc4", "#c8423b")
# Lines of a chart differ in these, too: not everyone sees colors, and not every page is printed in them.
DASHES = ("-", "--", ":", "-.", (0, (6, 1.5, 1, 1.5, 1, 1.5)))
_SIZE = (5.2, 3.1)  # inches; the page scales it
_MAP_SIZE = (5.2, 4.2)


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
        for line, color, dash in zip(lines, COLORS, DASHES, strict=False):
            marker = {"marker": "o", "markersize": 4.5} if line.marker else {}
            axes.plot(
                line.x,
                line.y,
                label=line.label,
                color=color,
                linestyle=dash,
                linewidth=1.8,
                **marker,
            )
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


def step_chart(steps: Sequence[Line], x_label: str, y_label: str) -> str:
    """Return an SVG element with histograms as outlines: ``x`` has one edge more than ``y`` has bins."""

    def draw(axes: Any) -> None:
        for line, color, dash in zip(steps, COLORS, DASHES, strict=False):
            style = {"color": color, "linestyle": dash, "linewidth": 1.8}
            axes.stairs(line.y, line.x, label=line.label, **style)
        axes.set_xlabel(x_label)
        axes.set_ylabel(y_label)
        axes.margins(x=0)
        axes.legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.2))

    return _svg(draw, _MAP_SIZE)


def map_chart(
    places: np.ndarray,
    directions: np.ndarray,
    marked: np.ndarray,
    ball: tuple[np.ndarray, float] | None,
    unit: str,
) -> str:
    """Return an SVG element with a path on a map, all axes in ``unit``.

    Args:
        places: along the path, shape (n, 2).
        directions: in which something looks at each place, shape (n, 2), of length 1 at most.
        marked: the places that were held out, shape (n,), bool; triangles instead of discs.
        ball: center, shape (2,), and radius of what is looked at; None: nothing of a known size.
        unit: of the axes.
    """

    def draw(axes: Any) -> None:
        axes.plot(*places.T, color=_INK, alpha=0.4, linewidth=0.8)
        look = {"angles": "xy", "width": 0.003, "headwidth": 1, "headlength": 0, "alpha": 0.6}
        axes.quiver(*places.T, *directions.T, color=_INK, scale=18, **look)
        for keep, mark, color, label in (
            (~marked, "o", COLORS[0], "training"),
            (marked, "^", COLORS[1], "held out"),
        ):
            if keep.any():
                axes.plot(*places[keep].T, mark, color=color, markersize=5, label=label)
        if ball is not None:
            turn = np.linspace(0, 2 * np.pi, 73)
            circle = ball[0] + ball[1] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
            axes.plot(*circle.T, "--", color=_INK, linewidth=1.2)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel(unit)
        axes.set_ylabel(unit)
        axes.legend(frameon=False, loc="best")

    return _svg(draw, _MAP_SIZE)


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
