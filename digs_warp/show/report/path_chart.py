"""The path of the cameras, seen from above, for pages without WebGL and for paper."""

from collections.abc import Sequence

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.show.film.camera_path import find_framed_subject, up_of
from digs_warp.show.report.markup import chart
from digs_warp.show.report.plots import map_chart


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
