"""The skin of a splat: the depth of the surface that it is part of.

A splat is a soft ball, and a surface is a layer of them, of which each hides a part. A photograph shows the
outside of that layer: splats that fit the photographs have their centers inside the object. In training
without a depth term, the true surface is found a number of standard deviations in front of the centers that
is nearly the same for all objects, and whatever their opacity:

    skin = center - REACH s,   s = 1 / |S^-1 R^T d|

d is the direction of the ray through the center, R the rotation and S the scales of the splat. A depth camera
measures the skin: a training that pulls the centers there moves the silhouettes out.

The order of the splats stays that of their centers. The backward pass takes REACH s as a constant, so a
gradient of the depth moves the centers, but does not change the scales through s.
"""

import warp as wp

from digs_warp.device.parallel import ParallelLaunch
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import ViewParams
from digs_warp.splat.records import GaussianArrays

wp.set_module_options({"enable_backward": False})

# [standard deviations] With it, the surface without a depth term is least biased: see docs/training.md.
REACH = 2.5

# A splat as wide as its distance has its skin at this share of the distance, not behind the camera.
_LEAST_SHARE = wp.constant(0.1)
_REACH = wp.constant(REACH)


@wp.kernel
def skin_kernel(
    first: int,
    gaussians: GaussianArrays,
    views: wp.array[ViewParams],  # [1]
    depths: wp.array[
        float
    ],  # [n] planar depth of the centers, 0 if not drawn; then of the skins [m]
):
    """Move the depth of one splat from its center to its skin."""
    g = first + wp.tid()
    depth = depths[g]
    if depth <= 0.0:
        return
    cam = views[0]
    ray = wp.normalize(gaussians.means[g] - cam.center_world)
    forward = wp.vec3(cam.rotation[2, 0], cam.rotation[2, 1], cam.rotation[2, 2])
    q = gaussians.quats[g]
    axes = wp.quat_to_matrix(wp.normalize(wp.quat(q[0], q[1], q[2], q[3])))
    along = wp.transpose(axes) * ray
    s = gaussians.log_scales[g]
    inverse = wp.vec3(wp.exp(-s[0]), wp.exp(-s[1]), wp.exp(-s[2]))
    deviation = 1.0 / wp.length(wp.cw_mul(along, inverse))
    ahead = _REACH * deviation
    depths[g] = wp.max(depth - ahead * wp.dot(ray, forward), _LEAST_SHARE * depth)


def skin_launch(
    gaussians: DeviceGaussians, views: wp.array, depths: wp.array, device: str, threads: int
) -> ParallelLaunch:
    """Return what moves the depths of the centers to those of the skins, in place."""
    inputs = [gaussians.for_kernels(), views, depths]
    return ParallelLaunch(skin_kernel, len(gaussians), inputs, device, threads, even=True)
