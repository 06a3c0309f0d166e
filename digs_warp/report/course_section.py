"""How the optimization went: quality of the held-out views, loss and number of splats over time."""

from collections.abc import Sequence
from typing import Any

from digs_warp.report.markup import chart, section
from digs_warp.report.plots import Line, line_chart
from digs_warp.report.results import Results

_PSNR = {"psnr": "full frame", "psnr_masked": "inside the mask"}
_SSIM = {"ssim": "full frame", "ssim_masked": "inside the mask"}


def course_section(results: Results) -> str:
    """Return the section; charts without two values are left out."""
    charts = [
        *_quality_chart(results.evaluations, "iteration", "iterations", _PSNR, "PSNR [dB]"),
        *_quality_chart(results.evaluations, "seconds", "training time [s]", _PSNR, "PSNR [dB]"),
        *_quality_chart(results.evaluations, "iteration", "iterations", _SSIM, "SSIM"),
        *_loss_chart(results.training),
        *_splats_chart(results.training),
    ]
    if not charts:
        return section("Course of the optimization", "The training log holds too few records.")
    return section(
        "Course of the optimization",
        "Views are held out from training and rendered now and then to see how far it has come.",
        f"<div class=charts>{''.join(charts)}</div>",
    )


def _quality_chart(
    records: Sequence[dict[str, Any]], key: str, x_label: str, metrics: dict[str, str], name: str
) -> list[str]:
    lines = [_line(records, key, metric, label, True) for metric, label in metrics.items()]
    lines = [line for line in lines if len(line.x) > 1]
    if not lines:
        return []
    first, last = lines[0].y[0], lines[0].y[-1]
    svg = line_chart(lines, x_label, f"{name}, held-out views")
    alt = f"{name} over {x_label}, from {first:.4g} to {last:.4g}"
    return [chart(svg, alt, f"Mean {name} of the held-out views over {x_label}; higher is better.")]


def _loss_chart(records: Sequence[dict[str, Any]]) -> list[str]:
    line = _line(records, "iteration", "loss", "loss")
    if len(line.x) < 2 or min(line.y) <= 0:
        return []
    svg = line_chart([line], "iterations", "training loss", log_y=True)
    alt = f"Training loss over iterations, from {line.y[0]:.3g} to {line.y[-1]:.3g}"
    caption = "Loss of the single view trained at each logged iteration, on a logarithmic scale."
    return [chart(svg, alt, caption)]


def _splats_chart(records: Sequence[dict[str, Any]]) -> list[str]:
    line = _line(records, "iteration", "splats", "splats")
    if len(line.x) < 2 or min(line.y) == max(line.y):
        return []  # a constant number stands on the cards
    svg = line_chart([line], "iterations", "Gaussians")
    alt = f"Number of Gaussians over iterations, from {line.y[0]:,.0f} to {line.y[-1]:,.0f}"
    return [chart(svg, alt, "Number of Gaussians.")]


def _line(
    records: Sequence[dict[str, Any]], x: str, y: str, label: str, marker: bool = False
) -> Line:
    known = [record for record in records if None not in (record.get(x), record.get(y))]
    return Line(label, [record[x] for record in known], [record[y] for record in known], marker)
