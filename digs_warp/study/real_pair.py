"""A real stereo pair with true disparity as a frame of the simulator: Middlebury's Motorcycle."""

import json
from functools import cached_property
from pathlib import Path

import numpy as np

from digs_warp.camera import Camera, Intrinsics
from digs_warp.checks import DigsError, require_file
from digs_warp.data.images import read_image
from digs_warp.sim.rig import StereoRig
from digs_warp.sim.scene import Material
from digs_warp.sim.sensor.frame import FrameTruth, Motion

# Surfaces are the same when their disparities differ by no more than this [px].
SAME_SURFACE = 1.0

# Standard deviation of the grain of these tripod exposures per channel [DN], at a quarter of their size. Luma
# has 0.5 DN, rounding included, in the most uniform blocks of either image (second differences across rows
# and columns, Immerkaer 1996).
IMAGE_NOISE = 0.75


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


def load_motorcycle(folder: Path) -> FrameTruth:
    """Return Middlebury's Motorcycle pair (quarter size, Scharstein et al. 2014) as a frame.

    The principal points of its two images differ. Depth here is f b over the disparity of the images,
    without that offset, because disparity is what the sensor's effects are about.

    Args:
        folder: holds left.png, right.png, disp.npz and calib.json.
    """
    left, right = (read_image(folder / f"{side}.png")[..., :3] for side in ("left", "right"))
    calibration = json.loads(require_file(folder / "calib.json", "calibration").read_text())
    with np.load(require_file(folder / "disp.npz", "true disparity")) as arrays:
        disparity = arrays[arrays.files[0]].astype(np.float64)
    disparity[~np.isfinite(disparity)] = np.nan
    height, width = disparity.shape
    focal = calibration["fx_px"]
    intrinsics = Intrinsics(
        width, height, focal, focal, calibration["cx_left_px"], calibration["cy_px"]
    )
    baseline = calibration["baseline_mm"] / 1000
    depth = (focal * baseline / disparity).astype(np.float32)
    rig = StereoRig(
        intrinsics=intrinsics,
        baseline=baseline,
        disparity_sigma=0.1,
        disparity_step=1 / 16,
        min_depth=0.9 * float(np.nanmin(depth)),
        max_depth=2.0 * float(np.nanmax(depth)),
        image_noise=IMAGE_NOISE,
    )
    return FrameTruth(
        number=0,
        camera=Camera(intrinsics, np.eye(4)),
        rig=rig,
        image=np.ascontiguousarray(left),
        right=np.ascontiguousarray(right),
        depth=depth,
        normals_world=np.broadcast_to(np.array([0, 0, -1], np.float32), (height, width, 3)),
        material_ids=np.zeros((height, width), dtype=np.int32),
        materials=(Material("unknown", np.full(3, 0.5, dtype=np.float32)),),
        motion=Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        rays=WarpedRays(disparity),
    )
