"""Where the cameras stood, and how far the surface is from the depth: charts and figures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.film.camera_path import find_framed_subject, up_of
from digs_warp.show.report.markup import chart, part
from digs_warp.show.report.plots import Line, line_chart, map_chart
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.adherence import MeasuredView, load_measured_views, signed_distances
from digs_warp.train.shutter import NO_MOTION, Shutter
from digs_warp.words import counted


def path_chart(by_time: Sequence[tuple[Frame, bool]], result: Reconstruction) -> str:
    """Return the chart: every camera, which were held out, and the object where there is one."""
    level = np.stack(_level_axes(up_of([frame.camera for frame, _ in by_time])))
    eyes = np.array([frame.camera.center_world for frame, _ in by_time]) @ level.T
    looks = np.array([frame.camera.world_from_cam[:3, 2] for frame, _ in by_time]) @ level.T
    held_out = np.array([out for _, out in by_time])
    ball = None
    if result.poses.subject == "object":
        subject = find_framed_subject(result.gaussians)
        ball = (level @ subject.center_world, subject.radius)
    unit = result.poses.metric_scale.unit if result.poses.metric_scale else "m"
    svg = map_chart(eyes, looks, held_out, ball, unit)
    seen = "; the dashed circle is the object" if ball else ""
    caption = f"From above, in the order of the recording: the cameras and where they look{seen}."
    alt = f"Path of {len(eyes)} cameras from above, {int(held_out.sum())} of them held out"
    return chart(svg, alt, caption)


def _level_axes(up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two horizontal axes of length 1 that are right and up on the map, seen from above."""
    axis = np.eye(3)[int(np.abs(up).argmin())]
    right = axis - (axis @ up) * up
    right /= np.linalg.norm(right)
    return right, np.cross(up, right)


BINS = 60

# The histogram reaches to this percentile of the distances of the widest of its curves.
SHOWN_PERCENT = 90.0


@dataclass(frozen=True, eq=False)
class Errors:
    """What was compared with what, and the differences [mm], shape (n,)."""

    label: str
    values: np.ndarray


def geometry_section(result: Reconstruction, posed: PosedFrames) -> str:
    """Return the part; without depth it has only the cameras.

    Args:
        result: with at least one Gaussian.
        posed: the frames with the cameras that were used, at least one.
    """
    views = posed.held_out or posed.training
    errors = depth_errors(result, views)
    which = "held-out views" if posed.held_out else "views"
    charts = [path_chart(posed.by_time, result), _histogram(errors, which) if errors else ""]
    return part(
        "cameras",
        "Cameras and depth" if errors else "Cameras",
        counted(len(posed.by_time), "camera"),
        f"<div class=charts>{''.join(charts)}</div>",
    )


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
