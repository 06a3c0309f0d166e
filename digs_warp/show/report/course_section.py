"""Training progress: quality of the held-out views, distance to the measured depth, number of Gaussians."""

from collections.abc import Callable, Sequence
from math import isfinite

from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.report.markup import chart, part
from digs_warp.show.report.plots import Line, line_chart
from digs_warp.train.training import CourseRow

_PSNR = {"on the object": "psnr_object", "full frame": "psnr_frame"}


def course_section(result: Reconstruction) -> str:
    """Return the section; charts without two values are left out."""
    rows, subject = result.course, result.poses.subject
    psnr = [
        _line(rows, label, lambda row, name=name: getattr(row.score, name, None))
        for label, name in _PSNR.items()
        if subject == "object" or name.endswith("_frame")
    ]
    apart = _line(
        rows, "adherence", lambda row: None if row.adherence is None else 1e3 * row.adherence
    )
    charts = [
        _chart(
            psnr, "PSNR of held-out views [dB]", "Mean of the held-out views; higher is better."
        ),
        _chart(
            [apart],
            "distance to the measured depth [mm]",
            "Median distance of the surface to the measured depth, which has the noise of the sensor in it. "
            "Where it rises, the surface leaves the measured depth.",
        ),
        _chart([_line(rows, "", lambda row: row.splats)], "Gaussians", "Number of Gaussians."),
    ]
    fact = (
        "quality and size along the way"
        if any(charts)
        else "the training log holds too few records"
    )
    return part("training", "Training", fact, f"<div class=charts>{''.join(charts)}</div>")


def _chart(lines: Sequence[Line], name: str, caption: str) -> str:
    """Return a chart of the lines that tell something: not of one value, or always the same."""
    lines = [line for line in lines if len({*line.y}) > 1]
    if not lines:
        return ""
    first, last = lines[0].y[0], lines[0].y[-1]
    alt = f"{name} over iterations, from {first:,.5g} to {last:,.5g}"
    return chart(line_chart(lines, "iterations", name), alt, caption)


def _line(
    rows: Sequence[CourseRow], label: str, value_of: Callable[[CourseRow], float | None]
) -> Line:
    """Return the curve through the rows where the value is known."""
    values = [(row.iteration, value_of(row)) for row in rows]
    known = [(a, b) for a, b in values if b is not None and isfinite(b)]
    return Line(label, [a for a, _ in known], [b for _, b in known], marker=len(known) < 50)
