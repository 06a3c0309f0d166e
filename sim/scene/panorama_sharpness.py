"""Whether a panorama is fine enough for the images that show it."""

import logging

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.scene.environment import Environment

_log = logging.getLogger(__name__)

# More pixels than this per texel look soft, and give a matcher less to go by than a real room would.
SOFT = 3.0

# Panoramas are sold in these widths, and in twice, four times ... as many pixels.
SMALLEST_WIDTH = 1024


def pixels_per_texel(environment: Environment, rig: StereoRig, distance: float) -> float:
    """Return how many pixels of the image a texel of the panorama covers, where the surround is nearest.

    Args:
        environment: with its final size.
        rig: the camera.
        distance: of the camera from the origin [m].
    """
    surround = environment.surround
    texel = np.pi / environment.radiance.shape[0]
    foot = np.array([0.0, 0.0, 0.0 if surround.floor is None else surround.floor])
    if surround.floor is None or surround.is_room:  # seen past the object
        from_center, from_camera = surround.radius, surround.radius + distance
    else:
        from_center = float(np.linalg.norm(foot - np.array(surround.center)))
        from_camera = float(np.hypot(distance, foot[2]))
    return texel * from_center / from_camera * rig.image_intrinsics.fx


def warn_if_soft(environment: Environment, rig: StereoRig, distance: float) -> None:
    """Say what panorama would be fine enough, if this one is not; see `pixels_per_texel`."""
    height, width = environment.radiance.shape[:2]
    magnified = pixels_per_texel(environment, rig, distance)
    if magnified <= SOFT:
        return
    fine = SMALLEST_WIDTH * 2 ** int(
        np.ceil(np.log2(max(1.0, width * magnified / SOFT / SMALLEST_WIDTH)))
    )
    _log.warning(
        "environment: %d x %d texels, each %.0f pixels wide in the image: the surround looks soft. Take a "
        "panorama of %d x %d, or fewer pixels (--width)",
        *(width, height, magnified, fine, fine // 2),
    )
