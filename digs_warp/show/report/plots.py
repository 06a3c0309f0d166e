"""Charts as inline SVG. Text and axes take the page's text color, so they fit light and dark pages.

They are written directly: a plotting library takes half a second to import, and as long for three charts.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np

COLORS = ("#2f7ed8", "#cf6c12", "#159a84", "#b04fc4", "#c8423b")
# Lines of a chart differ in these, too: not everyone sees colors, and not every page is printed in them.
DASHES = ("none", "8 4", "2 3", "8 3 2 3", "9 3 2 3 2 3")

# In pixels; the page scales a chart. A letter of its font is this wide, on average.
_SIZE, _MAP_SIZE, _LETTER = (520, 330), (520, 420), 7.2


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
    x = _Axis.around((value for line in lines for value in line.x), 0.02)
    y = _Axis.around((value for line in lines for value in line.y), 0.08, log_y)
    plot = _Plot(_SIZE, x, y, x_label, y_label, lines if len(lines) > 1 else ())
    for number, line in enumerate(lines):
        points = plot.places(line.x, line.y)
        plot.add(_stroke(number, _path(points)))
        for place in points if line.marker else ():
            plot.add(_mark(0, place, number))
    return plot.svg()


def bar_chart(bars: Sequence[Bar], x_label: str) -> str:
    """Return an SVG element with one labeled horizontal bar each, top to bottom."""
    groups = list(dict.fromkeys(bar.group for bar in bars))
    x = _Axis.around((0.0, 1.1 * max(bar.value for bar in bars)), 0.0)
    names = {number + 0.5: bar.label for number, bar in enumerate(bars)}
    y = _Axis(float(len(bars)), 0.0, names)
    plot = _Plot((640, 75 + 30 * len(bars)), x, y, x_label)
    for (middle, _), bar in zip(names.items(), bars, strict=True):
        color = COLORS[groups.index(bar.group) % len(COLORS)]
        (left, down), (right, _) = plot.places((0.0, bar.value), (middle, middle))
        size = f'width="{right - left:.1f}" height="20" fill="{color}"'
        plot.add(f'<rect x="{left:.1f}" y="{down - 10:.1f}" {size}/>')
        plot.write(f"{bar.value:.1f}", right + 5, down + 4, "start")
    return plot.svg()


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
    corners = [places] if ball is None else [places, ball[0] + ball[1] * np.array([[-1], [1]])]
    low, high = (pick(np.concatenate(corners), axis=0) for pick in (np.min, np.max))
    field = np.array([430.0, 340.0])
    metre = 0.92 * float((field / np.maximum(high - low, 1e-9)).min())  # in both directions [px]
    ends = np.stack([-field, field]) / (2 * metre) + (low + high) / 2
    x, y = (_Axis.around(each, 0.0) for each in ends.T)
    plot = _Plot(
        _MAP_SIZE, x, y, unit, unit, ("training", "held out")[: 1 + marked.any()], tuple(field)
    )
    at, ahead = plot.places(*places.T), plot.places(*(places + 24 / metre * directions).T)
    looks = "".join(_path(np.stack(pair)) for pair in zip(at, ahead, strict=True))
    for path, opacity in ((_path(at), 0.4), (looks, 0.6)):
        plot.add(f'<path fill="none" stroke="currentColor" opacity="{opacity}" d="{path}"/>')
    for place, is_held_out in zip(at, marked.astype(int), strict=True):
        plot.add(_mark(is_held_out, place, is_held_out))
    if ball is not None:
        ((right, down),) = plot.places(*ball[0][:, None])
        ring = f'cx="{right:.1f}" cy="{down:.1f}" r="{metre * ball[1]:.1f}" stroke-dasharray="6 4"'
        plot.add(f'<circle {ring} fill="none" stroke="currentColor" stroke-width="1.5"/>')
    return plot.svg()


@dataclass(frozen=True)
class _Axis:
    """The values at its start and end, logarithms if it is logarithmic, and its ticks: value -> text."""

    low: float
    high: float
    ticks: dict[float, str]
    is_log: bool = False

    @staticmethod
    def around(values: Iterable[float], margin: float, log: bool = False) -> "_Axis":
        """Return an axis that reaches beyond the values by this share of their range."""
        known = np.log10([*values]) if log else np.array([*values])
        low, high = float(known.min()), float(known.max())
        if high - low <= 1e-9 * max(abs(low), abs(high)):
            low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
        reach = margin * (high - low)
        low, high = low - reach, high + reach
        steps = _steps(low, high)
        if log:
            steps = [m * 10.0**n for n in range(int(low) - 1, int(high) + 1) for m in (1, 2, 5)]
            steps = [step for step in steps if low <= np.log10(step) <= high]
            steps = steps if len(steps) > 1 else _steps(10**low, 10**high)
        ticks = {float(np.log10(step)) if log else step: f"{step:,.6g}" for step in steps}
        return _Axis(low, high, ticks, log)

    def shares(self, values: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return where values lie, 0 at the start and 1 at the end."""
        return (np.asarray(values, np.float64) - self.low) / (self.high - self.low)


def _steps(low: float, high: float) -> list[float]:
    """Return up to seven round values in a range, evenly spaced."""
    wanted = (high - low) / 6
    power = 10.0 ** np.floor(np.log10(wanted))
    step = next(power * m for m in (1, 2, 5, 10) if power * m >= wanted * (1 - 1e-9))
    first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    return [float(n * step) for n in range(first, last + 1)]


@dataclass
class _Plot:
    """The axes of a chart, and what is drawn into them.

    Attributes:
        size: of the chart [px].
        x: upward to the right.
        y: upward.
        x_label: below the axis.
        y_label: beside it.
        legend: lines, or the words for discs and triangles; the first has the first color.
        inside: size of the field within the axes [px]; None: what is left.
    """

    size: tuple[int, int]
    x: _Axis
    y: _Axis
    x_label: str
    y_label: str = ""
    legend: Sequence[Line | str] = ()
    inside: tuple[float, float] | None = None
    parts: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Draw axes and legend."""
        width, height = self.size
        start = 16 + (22 if self.y_label else 0)
        self.left = start + _LETTER * max(map(len, self.y.ticks.values()), default=0)
        self.top = 8.0 + 22.0 * self._legend()
        wide, tall = self.inside or (width - 16 - self.left, height - 46 - self.top)
        self.wide, self.tall = wide, tall
        bottom, right = self.top + tall, self.left + wide
        grid = ""
        for text, share in zip(self.x.ticks.values(), self.x.shares([*self.x.ticks]), strict=True):
            across = self.left + share * wide
            grid += f"M{across:.1f} {self.top:.1f}V{bottom:.1f}"
            self.write(text, across, bottom + 18)
        for text, share in zip(self.y.ticks.values(), self.y.shares([*self.y.ticks]), strict=True):
            up = bottom - share * tall
            grid += f"M{self.left:.1f} {up:.1f}H{right:.1f}" if self.y_label else ""
            self.write(text, self.left - 7, up + 4, "end")
        self.add(f'<path stroke="currentColor" opacity="0.15" d="{grid}"/>')
        frame = f"M{self.left:.1f} {self.top:.1f}V{bottom:.1f}H{right:.1f}"
        self.add(f'<path fill="none" stroke="currentColor" d="{frame}"/>')
        self.write(self.x_label, self.left + wide / 2, bottom + 38)
        if self.y_label:
            turned = f' transform="rotate(-90 16 {self.top + tall / 2:.1f})"'
            self.write(self.y_label, 16, self.top + tall / 2, "middle", turned)

    def _legend(self) -> int:
        """Write the legend above the field; return its rows."""
        at, row = 16.0, 0
        for number, entry in enumerate(self.legend):
            label = entry.label if isinstance(entry, Line) else entry
            long = 56 + _LETTER * len(label)
            if at + long > self.size[0] + 10 and at > 16:
                at, row = 16.0, row + 1
            down = 16 + 22 * row
            line = _stroke(number, f"M{at:.1f} {down}h28")
            self.add(line if isinstance(entry, Line) else _mark(number, (at + 22, down), number))
            self.write(label, at + 34, down + 4, "start")
            at += long
        return row + 1 if self.legend else 0

    def places(
        self, x: Sequence[float] | np.ndarray, y: Sequence[float] | np.ndarray
    ) -> np.ndarray:
        """Return the pixels of values, to the right and down, (n, 2)."""
        heights = np.log10(y) if self.y.is_log else y
        right = self.left + self.wide * self.x.shares(x)
        down = self.top + self.tall * (1.0 - self.y.shares(heights))
        return np.stack([right, down], axis=1)

    def add(self, element: str) -> None:
        """Draw something over the rest."""
        self.parts.append(element)

    def write(self, text: str, x: float, y: float, anchor: str = "middle", more: str = "") -> None:
        """Write a text; ``anchor``: start, middle or end of it is at ``x`` [px]."""
        at = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"'
        self.add(f'<text fill="currentColor" {at}{more}>{escape(text)}</text>')

    def svg(self) -> str:
        """Return all that was drawn."""
        width, height = self.size
        head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
        return f'{head} font-size="13">{"".join(self.parts)}</svg>'


def _stroke(number: int, path: str) -> str:
    """Return a line with the color and the dashes of its number."""
    style = (
        f'stroke="{COLORS[number % len(COLORS)]}" stroke-dasharray="{DASHES[number % len(DASHES)]}"'
    )
    return f'<path fill="none" stroke-linejoin="round" stroke-width="2" {style} d="{path}"/>'


def _mark(shape: int, place: Sequence[float], color: int) -> str:
    """Return a disc (0) or a triangle (1) at a place [px]."""
    right, down = place
    if shape:
        return f'<path d="M{right - 4:.1f} {down + 3.5:.1f}h8l-4 -8z" fill="{COLORS[color]}"/>'
    return f'<circle cx="{right:.1f}" cy="{down:.1f}" r="3.5" fill="{COLORS[color]}"/>'


def _path(points: np.ndarray) -> str:
    """Return a path through places [px], (n, 2), as SVG writes it."""
    return "M" + "L".join(f"{right:.1f} {down:.1f}" for right, down in points)
