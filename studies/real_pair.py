"""A real stereo pair with true disparity as a frame of the simulator: Middlebury's Motorcycle."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.checks import require_file
from digs_warp.data.images import read_image
from digs_warp.geometry.camera import Intrinsics
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.fit.known_frame import known_frame
from digs_warp.sim.sensor.frame import FrameTruth

# Standard deviation of the grain of these tripod exposures per channel [DN], at a quarter of their size. Luma
# has 0.5 DN, rounding included, in the most uniform blocks of either image (second differences across rows
# and columns, Immerkaer 1996).
IMAGE_NOISE = 0.75


@dataclass(frozen=True, eq=False)
class Pair:
    """A stereo pair with true disparity.

    Attributes:
        intrinsics: of the left eye.
        baseline: [m].
        left, right: sRGB, (height, width, 3), uint8.
        disparity: true one of the left image [px], (height, width), float64, NaN where it is not known.
    """

    intrinsics: Intrinsics
    baseline: float
    left: np.ndarray
    right: np.ndarray
    disparity: np.ndarray


def read_pair(folder: Path) -> Pair:
    """Read left.png, right.png, disp.npz and calib.json."""
    left, right = (read_image(folder / f"{side}.png") for side in ("left", "right"))
    with np.load(require_file(folder / "disp.npz", "true disparity")) as arrays:
        disparity = arrays[arrays.files[0]].astype(np.float64)
    disparity[~(np.isfinite(disparity) & (disparity > 0))] = np.nan
    k = json.loads(require_file(folder / "calib.json", "calibration").read_text())
    camera = Intrinsics(
        left.shape[1], left.shape[0], k["fx_px"], k["fx_px"], k["cx_left_px"], k["cy_px"]
    )
    return Pair(camera, k["baseline_mm"] / 1000, left[..., :3], right[..., :3], disparity)


def load_motorcycle(folder: Path) -> FrameTruth:
    """Return Middlebury's Motorcycle pair (quarter size, Scharstein et al. 2014) as a frame.

    The principal points of its two images differ. Depth here is f b over the disparity of the images,
    without that offset, because disparity is what the sensor's effects are about.

    Args:
        folder: holds left.png, right.png, disp.npz and calib.json.
    """
    pair = read_pair(folder)
    depth = pair.intrinsics.fx * pair.baseline / pair.disparity
    rig = StereoRig(
        intrinsics=pair.intrinsics,
        baseline=pair.baseline,
        disparity_sigma=0.1,
        disparity_step=1 / 16,
        min_depth=0.9 * float(np.nanmin(depth)),
        max_depth=2.0 * float(np.nanmax(depth)),
        image_noise=IMAGE_NOISE,
    )
    return known_frame(pair.left, pair.right, pair.disparity, rig)
