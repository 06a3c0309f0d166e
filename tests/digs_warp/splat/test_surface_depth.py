"""The depth of the surface: the mean over the splats of one surface, never one between two surfaces."""

import numpy as np

from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.geometry.sh import sh_from_rgb
from digs_warp.splat.config import EXPECTED, RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.renderer import SplatRenderer
from digs_warp.splat.surface_depth import surface_depth

# A wall of splats one metre away, and another one behind its left half.
NEAR, FAR = 1.0, 1.4
ROUGHNESS = 0.003  # [m]


def wall(distance: float, left: float, right: float, opacity_logit: float) -> Gaussians:
    """Splats 8 mm apart along y = distance, off it by a few millimetres at random."""
    rng = np.random.default_rng(0)
    across, up = np.meshgrid(np.arange(left, right, 0.008), np.arange(-0.2, 0.2, 0.008))
    off = ROUGHNESS * rng.normal(size=across.size)
    means = np.stack([across.ravel(), distance + off, up.ravel()], axis=1)
    count = len(means)
    return Gaussians(
        means=means,
        log_scales=np.full((count, 3), np.log(0.006)),
        quats=np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        opacity_logits=np.full(count, opacity_logit),
        sh=sh_from_rgb(np.full((count, 3), 0.5))[:, None],
    )


def drawn(gaussians: Gaussians) -> np.ndarray:
    k = Intrinsics.from_fov(64, 64, 20.0)
    camera = Camera(k, look_at(np.zeros(3), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])))
    options = RasterOptions(outputs="depth", depth_of="skin")
    renderer = SplatRenderer(DeviceGaussians.from_numpy(gaussians), 64, 64, options=options)
    renderer.forward(camera, near=0.1)
    return renderer.depth.to_numpy()


def test_no_depth_between_two_walls() -> None:
    near, far = wall(NEAR, 0.0, 0.3, -0.5), wall(FAR, -0.5, 0.5, 1.0)
    both = Gaussians(*(np.concatenate([getattr(near, n), getattr(far, n)]) for n in FIELDS))
    depth = drawn(both)
    between = (depth[..., EXPECTED] > NEAR + 0.03) & (depth[..., EXPECTED] < FAR - 0.05)
    assert between.any()
    found = surface_depth(depth)
    assert not ((found > NEAR + 0.03) & (found < FAR - 0.05)).any()


def test_without_a_surface_there_is_no_depth() -> None:
    channels = np.array([[0.0, 0.0], [1.0, 0.0], [1.001, 1.0], [1.2, 1.0]], np.float32)
    np.testing.assert_array_equal(
        surface_depth(channels), np.array([np.nan, np.nan, 1.001, 1.0], np.float32)
    )
