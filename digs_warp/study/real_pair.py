"""A real stereo pair with true disparity as a frame of the simulator: Middlebury's Motorcycle."""

from pathlib import Path

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.fit.known_frame import known_frame
from digs_warp.sim.fit.pair_folder import read_pair
from digs_warp.sim.sensor.frame import FrameTruth

# Standard deviation of the grain of these tripod exposures per channel [DN], at a quarter of their size. Luma
# has 0.5 DN, rounding included, in the most uniform blocks of either image (second differences across rows
# and columns, Immerkaer 1996).
IMAGE_NOISE = 0.75


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
