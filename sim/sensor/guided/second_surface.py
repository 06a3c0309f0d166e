"""What shows through glass or is reflected in a mirror: a second disparity that the images may contain."""

from collections.abc import Collection

import numpy as np

from digs_warp.sim.sensor.effects.mirror import Mirror
from digs_warp.sim.sensor.effects.transparency import Transparency
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.materials import is_mirror, is_thin_glass
from digs_warp.sim.sensor.virtual_image import virtual_disparity


def second_disparity(truth: FrameTruth, effects: Collection[str]) -> np.ndarray | None:
    """Return the disparity [px] of what lies behind glass or appears in mirrors, as the images show it.

    Shape (height, width), float32, NaN where there is no such material; None where none is in view: then
    no ray is cast.

    Args:
        truth: its rays find what lies behind and what is reflected.
        effects: names of those whose surfaces to look for; other names change nothing.
    """
    glass = _if_any(truth.pixels_of(is_thin_glass)) if Transparency.name in effects else None
    mirrors = _if_any(truth.pixels_of(is_mirror)) if Mirror.name in effects else None
    if glass is None and mirrors is None:
        return None
    second = (
        np.full(truth.depth.shape, np.nan, np.float32) if glass is None else _behind(truth, glass)
    )
    if mirrors is not None:
        reflected = virtual_disparity(truth, mirrors)
        np.copyto(second, reflected, where=mirrors, casting="same_kind")
    return truth.drift.shown_disparity(second, truth.rig.intrinsics)


def _behind(truth: FrameTruth, glass: np.ndarray) -> np.ndarray:
    """Return the disparity [px] of what shows through, (height, width), float32, NaN where nothing does."""
    # The ray goes straight on, as in the images. What a body shows bent has no such disparity.
    return np.float32(truth.rig.focal_baseline) / truth.rays.depth_behind(glass)


def _if_any(where: np.ndarray | None) -> np.ndarray | None:
    """Return the mask, None if it is empty."""
    return where if where is not None and where.any() else None
