"""Frames of which only images and true disparity are known: recorded pairs, and pairs made from one image."""

from functools import cached_property

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.geometry.camera import Camera
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.drift import NO_DRIFT, Drift
from digs_warp.sim.sensor.frame import FrameTruth, Motion

# Surfaces are the same when their disparities differ by no more than this [px].
SAME_SURFACE = 1.0


class WarpedRays:
    """The rays of a frame with known disparity only: all surfaces are opaque and reflect nothing."""

    def __init__(self, disparity: np.ndarray) -> None:
        self._disparity = disparity

    def right_visibility(
        self, where: np.ndarray | None = None, depth: np.ndarray | None = None
    ) -> np.ndarray:
        """Whether a pixel is in front when all pixels are moved into the right image."""
        return self._right_visibility if where is None else self._right_visibility | ~where

    @cached_property
    def _right_visibility(self) -> np.ndarray:
        disparity = self._disparity
        height, width = disparity.shape
        front = np.full((height, width + 2), -np.inf)
        rows, columns = np.nonzero(~np.isnan(disparity))
        value = disparity[rows, columns]
        order = np.argsort(value)  # the nearest is written last
        rows, columns, value = rows[order], columns[order], value[order]
        target = columns - value
        # Both neighbors: adjacent pixels of a slanted surface can land two pixels apart.
        for column in (np.floor(target), np.ceil(target)):
            inside = (column >= 0) & (column < width)
            np.maximum.at(front, (rows[inside], column[inside].astype(int)), value[inside])
        landing = np.round(target)
        inside = landing >= 0
        visible = np.ones(disparity.shape, dtype=bool)
        ahead = front[rows[inside], landing[inside].astype(int)]
        visible[rows[inside], columns[inside]] = ahead <= value[inside] + SAME_SURFACE
        return visible

    def reflection_distance(self, where: np.ndarray | None = None) -> np.ndarray:
        """Unknown for a recorded pair."""
        raise DigsError("a recorded pair has no information about reflections")

    def depth_behind(self, where: np.ndarray | None = None) -> np.ndarray:
        """Unknown for a recorded pair."""
        raise DigsError("a recorded pair has no information about what lies behind its surfaces")


def known_frame(
    left: np.ndarray,
    right: np.ndarray,
    disparity: np.ndarray,
    rig: StereoRig,
    number: int = 0,
    drift: Drift = NO_DRIFT,
) -> FrameTruth:
    """Return a pair with true disparity as a frame of the simulator.

    Args:
        left: image, sRGB, (height, width, 3), uint8.
        right: likewise.
        disparity: true one of the left image [px], (height, width), NaN where it is not known.
        rig: the camera.
        number: of the frame, >= 0.
        drift: of the eye that saw ``right``.
    """
    shape = disparity.shape
    return FrameTruth(
        number=number,
        camera=Camera(rig.intrinsics, np.eye(4)),
        rig=rig,
        image=np.ascontiguousarray(left),
        right=np.ascontiguousarray(right),
        depth=(rig.focal_baseline / np.asarray(disparity, np.float64)).astype(np.float32),
        normals_world=np.broadcast_to(np.array([0, 0, -1], np.float32), (*shape, 3)),
        material_ids=np.zeros(shape, dtype=np.int32),
        materials=(Material("unknown", np.full(3, 0.5, dtype=np.float32)),),
        motion=Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        rays=WarpedRays(disparity),
        drift=drift,
    )
