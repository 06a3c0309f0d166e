"""What shows through glass or is reflected in a mirror: a second disparity that the images may contain."""

from collections.abc import Callable
from typing import Literal

import numpy as np

from digs_warp.sim.scene import Material
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.materials import is_mirror, is_transparent, pixels_of
from digs_warp.sim.sensor.virtual_image import virtual_disparity

SecondSurface = Literal["transparency", "mirror"]
SECOND_SURFACES: frozenset[SecondSurface] = frozenset(("transparency", "mirror"))


def second_disparity(truth: FrameTruth, kinds: frozenset[SecondSurface]) -> np.ndarray | None:
    """Return the disparity [px] of what lies behind glass or appears in mirrors, as the images show it.

    Shape (height, width), float32, NaN where there is no such material; None where none is in view: then
    no ray is cast.

    Args:
        truth: its rays find what lies behind and what is reflected.
        kinds: those to look for.
    """
    glass = _seen(truth, is_transparent) if "transparency" in kinds else None
    mirrors = _seen(truth, is_mirror) if "mirror" in kinds else None
    if glass is None and mirrors is None:
        return None
    second = np.full(truth.depth.shape, np.nan, np.float32)
    if glass is not None:
        # The ray goes straight on: the rendered images have no refraction either.
        behind = np.float32(truth.rig.focal_baseline) / truth.rays.depth_behind(glass)
        np.copyto(second, behind, where=glass)
    if mirrors is not None:
        reflected = virtual_disparity(truth, mirrors)
        np.copyto(second, reflected, where=mirrors, casting="same_kind")
    return truth.drift.shown_disparity(second, truth.rig.intrinsics)


def _seen(truth: FrameTruth, test: Callable[[Material], bool]) -> np.ndarray | None:
    """Return where the material passes ``test``, (height, width), bool; None: nowhere."""
    where = pixels_of(truth, test)
    return where if where is not None and where.any() else None
