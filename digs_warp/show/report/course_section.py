"""Training progress: quality of the held-out views, loss and number of splats over time."""

from collections.abc import Callable, Sequence
from math import isfinite
from operator import attrgetter

from digs_warp.init.start import Subject
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.report.markup import chart, part
from digs_warp.show.report.plots import Line, line_chart
from digs_warp.train.training import CourseRow

_PSNR = {"psnr_object": "on the object", "psnr_frame": "full frame"}
_SSIM = {"ssim_object": "on the object", "ssim_frame": "full frame"}

_Value = Callable[[CourseRow], float | None]
_iteration: _Value = attrgetter("iteration")


def course_section(result: Reconstruction) -> str:
    """Return the section; charts without two values are left out."""
    rows = result.course
    psnr, ssim = _shown(_PSNR, result.poses.subject), _shown(_SSIM, result.poses.subject)
    charts = [
        *_quality_chart(rows, _iteration, "iterations", psnr, "PSNR [dB]"),
        *_quality_chart(rows, lambda row: row.seconds, "training time [s]", psnr, "PSNR [dB]"),
        *_quality_chart(rows, _iteration, "iterations", ssim, "SSIM"),
        *_adherence_chart(rows),
        *_loss_chart(rows),
        *_splats_chart(rows),
    ]
    fact = (
        "held-out views along the training" if charts else "the training log holds too few records"
    )
    return part("training", "Training", fact, f"<div class=charts>{''.join(charts)}</div>")


def _shown(metrics: dict[str, str], subject: Subject) -> dict[str, str]:
    """Return the metrics to show: without an object, only those of the whole frame."""
    return {k: v for k, v in metrics.items() if subject == "object" or k.endswith("_frame")}


def _quality_chart(
    rows: Sequence[CourseRow], x: _Value, x_label: str, metrics: dict[str, str], name: str
) -> list[str]:
    measured = [row for row in rows if row.score]
    lines = [
        _line(measured, x, lambda row, m=metric: getattr(row.score, m), label, marker=True)
        for metric, label in metrics.items()
    ]
    lines = [line for line in lines if len(line.x) > 1]
    if not lines:
        return []
    first, last = lines[0].y[0], lines[0].y[-1]
    svg = line_chart(lines, x_label, f"{name}, held-out views")
    alt = f"{name} over {x_label}, from {first:.4g} to {last:.4g}"
    return [chart(svg, alt, f"Mean {name} of the held-out views over {x_label}; higher is better.")]


def _adherence_chart(rows: Sequence[CourseRow]) -> list[str]:
    line = _line(
        rows,
        _iteration,
        lambda row: None if row.adherence is None else 1e3 * row.adherence,
        "adherence",
        marker=True,
    )
    if len(line.x) < 2:
        return []
    svg = line_chart([line], "iterations", "distance to the measured depth [mm]")
    alt = f"Adherence over iterations, from {line.y[0]:.3g} to {line.y[-1]:.3g} mm"
    caption = (
        "Median distance of the surface to the measured depth, which has the noise of the sensor in it. "
        "Where it rises, the surface leaves the measured depth."
    )
    return [chart(svg, alt, caption)]


def _loss_chart(rows: Sequence[CourseRow]) -> list[str]:
    line = _line(rows, _iteration, lambda row: row.loss, "loss")
    if len(line.x) < 2 or min(line.y) <= 0:
        return []
    svg = line_chart([line], "iterations", "training loss", log_y=True)
    alt = f"Training loss over iterations, from {line.y[0]:.3g} to {line.y[-1]:.3g}"
    caption = "Loss of the single view trained at each logged iteration, on a logarithmic scale."
    return [chart(svg, alt, caption)]


def _splats_chart(rows: Sequence[CourseRow]) -> list[str]:
    line = _line(rows, _iteration, lambda row: row.splats, "splats")
    if len(line.x) < 2 or min(line.y) == max(line.y):
        return []  # a constant number is above
    svg = line_chart([line], "iterations", "Gaussians")
    alt = f"Number of Gaussians over iterations, from {line.y[0]:,.0f} to {line.y[-1]:,.0f}"
    return [chart(svg, alt, "Number of Gaussians.")]


def _line(
    rows: Sequence[CourseRow], x: _Value, y: _Value, label: str, marker: bool = False
) -> Line:
    """Return the curve through the rows where ``y`` is known."""
    values = [(x(row), y(row)) for row in rows]
    known = [(a, b) for a, b in values if a is not None and b is not None and isfinite(b)]
    return Line(label, [a for a, _ in known], [b for _, b in known], marker)
