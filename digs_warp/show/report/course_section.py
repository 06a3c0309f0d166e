"""How the likeness of the held-out views grew with the training: a chart, as inline SVG.

Text and axes take the page's text color, so they fit light and dark pages. It is written directly: a plotting
library takes half a second to import.
"""

from math import isfinite

import numpy as np

from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.report.markup import figure, part

# Of the chart, and of the field within its axes [px]; the page scales it.
_WIDTH, _HEIGHT, _LEFT, _TOP, _RIGHT, _BOTTOM = 520, 330, 62, 12, 504, 284


def course_section(result: Reconstruction) -> str:
    """Return the section; a chart without two values is left out."""
    name = "psnr_object" if result.poses.subject == "object" else "psnr_frame"
    values = [(row.iteration, getattr(row.score, name, None)) for row in result.course]
    known = [(at, value) for at, value in values if value is not None and isfinite(value)]
    if len({value for _, value in known}) < 2:
        return part("training", "Training", "the training log holds too few records")
    alt = f"PSNR over iterations, from {known[0][1]:.2f} to {known[-1][1]:.2f} dB"
    drawn = f'<div class=chart role=img aria-label="{alt}">{line_chart(np.array(known))}</div>'
    caption = "Mean of the held-out views; higher is better."
    return part("training", "Training", "likeness along the way", figure(drawn, caption))


def line_chart(points: np.ndarray) -> str:
    """Return an SVG element of a line through iterations and PSNR [dB], shape (n, 2)."""
    x, y = map(_ticks, points.T)

    def across(value: float) -> float:
        return _LEFT + (_RIGHT - _LEFT) * (value - x[0]) / (x[-1] - x[0])

    def down(value: float) -> float:
        return _BOTTOM - (_BOTTOM - _TOP) * (value - y[0]) / (y[-1] - y[0])

    grid = "".join(f"M{across(tick):.1f} {_TOP}V{_BOTTOM}" for tick in x)
    grid += "".join(f"M{_LEFT} {down(tick):.1f}H{_RIGHT}" for tick in y)
    line = "L".join(f"{across(a):.1f} {down(b):.1f}" for a, b in points.tolist())
    middle = (_TOP + _BOTTOM) / 2
    parts = [
        f'<path stroke="currentColor" opacity="0.15" d="{grid}"/>',
        f'<path fill="none" stroke-width="2" stroke="#2f7ed8" d="M{line}"/>',
        *(_text(f"{tick:,.6g}", across(tick), _BOTTOM + 18) for tick in x),
        *(_text(f"{tick:,.6g}", _LEFT - 7, down(tick) + 4, "end") for tick in y),
        _text("iterations", (_LEFT + _RIGHT) / 2, _BOTTOM + 38),
        _text("PSNR [dB]", 16, middle, more=f' transform="rotate(-90 16 {middle})"'),
    ]
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}"'
    return f'{head} font-size="13">{"".join(parts)}</svg>'


def _ticks(values: np.ndarray) -> list[float]:
    """Return round numbers in even steps, from below the values to above them."""
    low, high = float(values.min()), float(values.max())
    wanted = max(high - low, 1e-9) / 6
    power = 10.0 ** np.floor(np.log10(wanted))
    step = next(power * m for m in (1, 2, 5, 10) if power * m >= wanted * (1 - 1e-9))
    return (step * np.arange(np.floor(low / step), np.ceil(high / step) + 1)).tolist()


def _text(text: str, x: float, y: float, anchor: str = "middle", more: str = "") -> str:
    """Return a text; ``anchor``: start, middle or end of it is at ``x`` [px]."""
    at = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"'
    return f'<text fill="currentColor" {at}{more}>{text}</text>'
