"""A distance that the user has measured, from which the scale of a recording without depth follows.

It is the distance between the places of two cameras: `0000,0031=0.30m`. A ruler along which the camera was
moved gives it, and it needs no point that is recognized in images.
"""

import re
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.metric_scale import BY_DEPTH, MetricScale
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.pipeline.poses import MetricModel
from digs_warp.words import did_you_mean

FORM = "two frames and their distance, such as 0000,0031=0.30m"

_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_PARTS = re.compile(r"([^,=]+),([^,=]+)=\s*([0-9.]+(?:e-?[0-9]+)?)\s*(m|cm|mm)\s*")


@dataclass(frozen=True)
class KnownDistance:
    """The distance between the cameras of two frames [m], above 0."""

    first: str
    second: str
    metres: float

    @staticmethod
    def parse(text: str) -> "KnownDistance":
        """Read the value of --scale-from.

        Raises:
            DigsError: another form, one frame twice, or no distance above 0.
        """
        parts = _PARTS.fullmatch(text)
        if parts is None:
            raise DigsError(f"--scale-from: '{text}', expected {FORM} (m, cm or mm)")
        first, second, number, unit = (part.strip() for part in parts.groups())
        try:
            metres = float(number) * _METRES[unit]
        except ValueError:
            metres = 0.0
        if not 0 < metres < np.inf or first == second:
            raise DigsError(
                f"--scale-from: '{text}', expected two different frames and a distance above 0"
            )
        return KnownDistance(first, second, metres)

    def units_per_metre(self, frames: PosedFrames) -> float:
        """Return how many units of the poses a metre has.

        Raises:
            DigsError: a frame is not among them, or both cameras are in one place.
        """
        centers = {frame.name: frame.camera.center_world for frame, _ in frames.by_time}
        for name in (self.first, self.second):
            if name not in centers:
                raise DigsError(
                    f"--scale-from: no frame '{name}' with a pose{did_you_mean(name, centers)}"
                )
        apart = float(np.linalg.norm(centers[self.first] - centers[self.second]))
        if not apart > 0:
            raise DigsError(
                f"--scale-from: the cameras of '{self.first}' and '{self.second}' are in one place; name two "
                "frames that were taken apart"
            )
        return apart / self.metres


def check_scale_from(capture: Capture, text: str | None) -> None:
    """Refuse a known distance where the depth maps tell the scale, or for frames that are not there.

    Raises:
        DigsError: as said, or another form.
    """
    if text is None:
        return
    distance = KnownDistance.parse(text)
    if capture.has_depth:
        raise DigsError(
            f"--scale-from: {capture} has depth maps, which tell the scale; leave it out"
        )
    names = [frame.name for frame in capture.frames]
    for name in (distance.first, distance.second):
        if name not in names:
            raise DigsError(f"--scale-from: no frame '{name}'{did_you_mean(name, names)}")


def metric_scale_of(capture: Capture, estimated: bool, scale_from: str | None) -> MetricScale:
    """Return what is known about the scale of a reconstruction; ``estimated``: whether its poses were."""
    if scale_from is not None:
        return MetricScale(True, f"the distance {scale_from} (--scale-from)")
    if estimated and not capture.has_depth:
        return MetricScale(
            False,
            "the poses were estimated without depth; give a known distance with --scale-from",
        )
    return BY_DEPTH if capture.has_depth else capture.metric_scale


def in_true_size(
    frames: PosedFrames, model: MetricModel | None, points: PointCloud | None, text: str
) -> tuple[PosedFrames, MetricModel | None, PointCloud | None]:
    """Return poses, model and points in metres, given the value of --scale-from.

    Raises:
        DigsError: as of `KnownDistance.units_per_metre`.
    """
    units = KnownDistance.parse(text).units_per_metre(frames)
    if model is not None:
        scale = model.sfm_per_metre * units
        model = replace(model, sfm=model.sfm.in_metres(units), sfm_per_metre=scale)
    if points is not None:
        points = replace(points, points_world=points.points_world / np.float32(units))
    return frames.in_metres(units), model, points
