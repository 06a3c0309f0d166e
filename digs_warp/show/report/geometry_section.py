"""How far the surface is from the measured and the true depth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.report.markup import chart, part
from digs_warp.show.report.plots import Line, line_chart
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.adherence import MeasuredView, load_measured_views, signed_distances
from digs_warp.train.shutter import NO_MOTION, Shutter

BINS = 60

# The histogram reaches to this percentile of the distances of the widest of its curves.
SHOWN_PERCENT = 90.0


@dataclass(frozen=True, eq=False)
class Errors:
    """What was compared with what, and the differences [mm], shape (n,)."""

    label: str
    values: np.ndarray


def geometry_section(result: Reconstruction, posed: PosedFrames) -> str:
    """Return the part.

    Args:
        result: with at least one Gaussian.
        posed: the frames with the cameras that were used, at least one.
    """
    views = posed.held_out or posed.training
    errors = depth_errors(result, views)
    which = "held-out views" if posed.held_out else "views"
    body = f"<div class=charts>{_histogram(errors, which)}</div>" if errors else ""
    fact = "where the surface, the measurement and the truth differ" if errors else "not recorded"
    return part("depth", "Depth", fact, body)


def depth_errors(result: Reconstruction, frames: Sequence[Frame]) -> list[Errors]:
    """Return the differences that are known: of the surface and of the sensor."""
    shutter = Shutter(result.training.rolling_shutter or NO_MOTION)
    measured = load_measured_views(frames, shutter)
    true = load_measured_views(frames, shutter, Layer.DEPTH_TRUE)
    gaussians = DeviceGaussians.from_numpy(result.gaussians)
    found = [
        Errors("surface - measured", 1e3 * signed_distances(gaussians, measured)),
        Errors("surface - true", 1e3 * signed_distances(gaussians, true)),
        Errors("measured - true", 1e3 * _sensor_errors(measured, true)),
    ]
    return [each for each in found if len(each.values)]


def _sensor_errors(measured: Sequence[MeasuredView], true: Sequence[MeasuredView]) -> np.ndarray:
    """Return measured minus true depth [m] where both are known."""
    if len(measured) != len(true):  # not every frame has both
        return np.zeros(0)
    differences = [a.depth - b.depth for a, b in zip(measured, true, strict=True)]
    found = np.concatenate([np.zeros(0), *(each.ravel() for each in differences)])
    return found[np.isfinite(found)]


def _histogram(errors: Sequence[Errors], which: str) -> str:
    limit = max(float(np.percentile(np.abs(each.values), SHOWN_PERCENT)) for each in errors)
    edges = np.linspace(-limit, limit, BINS + 1) if limit > 0 else np.linspace(-1.0, 1.0, BINS + 1)
    lines = []
    for each in errors:
        counts = np.histogram(each.values, edges)[0]
        steps = np.repeat(100.0 * counts / len(each.values), 2)
        lines.append(Line(each.label, np.repeat(edges, 2).tolist(), [0.0, *steps, 0.0]))
    svg = line_chart(lines, "difference [mm]", "share of pixels [%]")
    alt = f"Histogram of differences of depth: {', '.join(each.label for each in errors)}"
    caption = (
        f"Differences of depth in at most 8 {which}, where both are known. Surface: what the Gaussians show. "
        "Above 0: too far. What lies beyond the ends of the axis is not drawn."
    )
    return chart(svg, alt, caption)
