"""A ZED 2 at any image size."""

from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.camera.rig import DEFAULT_FOV_DEG, StereoRig


def zed2_like(width: int, height: int, horizontal_fov_deg: float = DEFAULT_FOV_DEG) -> StereoRig:
    """Return a rig with the parameters of a ZED 2."""
    return load_profile("zed2-720").rig(width, height, horizontal_fov_deg)
