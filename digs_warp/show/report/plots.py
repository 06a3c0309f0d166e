"""Charts of lines as inline SVG. Text and axes take the page's text color, so they fit light and dark pages.

They are written directly: a plotting library takes half a second to import, and as long for three charts.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

COLORS = ("#2f7ed8", "#cf6c12", "#159a84")
# Lines of a chart differ in these, too: not everyone sees colors, and not every page is printed in them.
DASHES = ("none", "8 4", "2 3")

# Of a chart, and of the field within its axes [px]; the page scales it. A letter is this wide, on average.
_WIDTH, _HEIGHT, _TOP, _RIGHT, _BOTTOM, _LETTER = 520, 330, 30, 504, 284, 7.2


@dataclass(frozen=True)
class Line:
    """One curve: a label for the legend, and points."""

    label: str
    x: Sequence[float]
    y: Sequence[float]
    marker: bool = False


def line_chart(lines: Sequence[Line], x_label: str, y_label: str) -> str:
    """Return an SVG element with up to three curves and, for several, a legend."""
    x = _Axis.around((value for line in lines for value in line.x), 0.02)
    y = _Axis.around((value for line in lines for value in line.y), 0.08)
    left = 38 + _LETTER * max(map(len, y.ticks.values()))
    parts = _axes(x, y, left, x_label, y_label)
    at = 16.0
    for line, color, dashes in zip(lines, COLORS, DASHES, strict=False):
        right = left + (_RIGHT - left) * x.shares(line.x)
        down = _BOTTOM - (_BOTTOM - _TOP) * y.shares(line.y)
        places = [f"{a:.1f} {b:.1f}" for a, b in zip(right, down, strict=True)]
        stroke = f'stroke="{color}" stroke-dasharray="{dashes}" d="'
        stroke = f'<path fill="none" stroke-linejoin="round" stroke-width="2" {stroke}'
        parts.append(f'{stroke}M{"L".join(places)}"/>')
        for a, b in zip(right, down, strict=True) if line.marker else ():
            parts.append(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3.5" fill="{color}"/>')
        if len(lines) > 1:
            parts += [f'{stroke}M{at:.1f} 16h28"/>', _text(line.label, at + 34, 20, "start")]
            at += 56 + _LETTER * len(line.label)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}"'
    return f'{head} font-size="13">{"".join(parts)}</svg>'


def _axes(x: "_Axis", y: "_Axis", left: float, x_label: str, y_label: str) -> list[str]:
    """Return grid, frame, ticks and labels."""
    middle, grid, texts = (_TOP + _BOTTOM) / 2, "", []
    for text, share in zip(x.ticks.values(), x.shares([*x.ticks]), strict=True):
        across = left + share * (_RIGHT - left)
        grid += f"M{across:.1f} {_TOP}V{_BOTTOM}"
        texts.append(_text(text, across, _BOTTOM + 18))
    for text, share in zip(y.ticks.values(), y.shares([*y.ticks]), strict=True):
        up = _BOTTOM - share * (_BOTTOM - _TOP)
        grid += f"M{left:.1f} {up:.1f}H{_RIGHT}"
        texts.append(_text(text, left - 7, up + 4, "end"))
    turned = f' transform="rotate(-90 16 {middle:.1f})"'
    return [
        f'<path stroke="currentColor" opacity="0.15" d="{grid}"/>',
        f'<path fill="none" stroke="currentColor" d="M{left:.1f} {_TOP}V{_BOTTOM}H{_RIGHT}"/>',
        *texts,
        _text(x_label, (left + _RIGHT) / 2, _BOTTOM + 38),
        _text(y_label, 16, middle, more=turned),
    ]


def _text(text: str, x: float, y: float, anchor: str = "middle", more: str = "") -> str:
    """Return a text; ``anchor``: start, middle or end of it is at ``x`` [px]."""
    at = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"'
    return f'<text fill="currentColor" {at}{more}>{escape(text)}</text>'


@dataclass(frozen=True)
class _Axis:
    """The values at its start and end, and its ticks: value -> text."""

    low: float
    high: float
    ticks: dict[float, str]

    @staticmethod
    def around(values: Iterable[float], margin: float) -> "_Axis":
        """Return an axis that reaches beyond the values by this share of their range."""
        known = [*values]
        low, high = min(known), max(known)
        if high - low <= 1e-9 * max(abs(low), abs(high)):
            low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
        reach = margin * (high - low)
        low, high = float(low - reach), float(high + reach)
        wanted = (high - low) / 6
        power = 10.0 ** np.floor(np.log10(wanted))
        step = next(power * m for m in (1, 2, 5, 10) if power * m >= wanted * (1 - 1e-9))
        first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
        steps = [float(n * step) for n in range(first, last + 1)]
        return _Axis(low, high, {value: f"{value:,.6g}" for value in steps})

    def shares(self, values: Sequence[float]) -> np.ndarray:
        """Return where values lie, 0 at the start and 1 at the end."""
        return (np.asarray(values, np.float64) - self.low) / (self.high - self.low)
