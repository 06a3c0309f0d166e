"""From which sides the cameras see the object: the widest gap in their way around it."""

from collections.abc import Sequence

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.viewpoints import looked_at, upward
from digs_warp.geometry.camera import Camera


def widest_gap(cameras: Sequence[Camera]) -> float | None:
    """Return the widest angle around the object in which no camera stands [degrees], 0 to 360.

    Angles are measured about the vertical axis through the point that the cameras look at. None if they all
    look in the same direction, or if the images have no common up.
    """
    up = upward(cameras)
    try:
        center = looked_at(cameras)
    except DigsError:
        return None
    if up is None:
        return None
    away = np.stack([camera.center_world for camera in cameras]) - center
    sideways = away - np.outer(away @ up, up)
    ahead = sideways[0]
    beside = np.cross(up, ahead)
    angles = np.sort(np.rad2deg(np.arctan2(sideways @ beside, sideways @ ahead)))
    return float(np.diff(angles, append=angles[0] + 360.0).max())
