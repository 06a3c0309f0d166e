"""The skin of a splat: the depth at which it hides half of what is behind it.

A splat is a soft ball, and a photograph shows where it ends, not where its center is: at a silhouette, the
object ends where the opacity of its last splats falls to one half. Along the ray through its center, a splat
of opacity o and standard deviation s has this opacity at the distance t in front of the center:

    o exp(-t^2 / (2 s^2)) = 1/2   =>   t = s sqrt(2 ln(2 o)),   0 where o <= 1/2

    s = 1 / |S^-1 R^T d|: d the direction of the ray, R the rotation, S the scales of the splat

So splats that fit the photographs have their centers t inside the object, and their skin on its surface. A
depth camera measures the skin: a training that pulls the centers there moves the silhouettes out.

Neighbors overlap, so that together they reach one half farther out: the skin is at OVERLAP t.

The order of the splats stays that of their centers. The backward pass takes t as a constant, so a gradient of
the depth moves the centers, but does not change the scales or the opacities through t.
"""

import warp as wp

from digs_warp.device.parallel import ParallelLaunch
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import ViewParams
from digs_warp.splat.records import GaussianArrays

wp.set_module_options({"enable_backward": False})

# Without a depth term, the surface of the cow "spot" (320x180, 300 steps) is 4.0 mm too deep with 1.3 and
# 2.0 mm with 2, that of the built-in vase 1.6 and 0.3 mm; with 2.6 the vase's is 0.9 mm too near.
OVERLAP = 2.0

# A splat as wide as its distance has its skin at this share of the distance, not behind the camera.
_LEAST_SHARE = wp.constant(0.1)
_OVERLAP = wp.constant(OVERLAP)


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
    opacity = 1.0 / (1.0 + wp.exp(-gaussians.opacity_logits[g]))
    ahead = _OVERLAP * deviation * wp.sqrt(2.0 * wp.log(wp.max(2.0 * opacity, 1.0)))
    depths[g] = wp.max(depth - ahead * wp.dot(ray, forward), _LEAST_SHARE * depth)


def skin_launch(
    gaussians: DeviceGaussians, views: wp.array, depths: wp.array, device: str, threads: int
) -> ParallelLaunch:
    """Return what moves the depths of the centers to those of the skins, in place."""
    inputs = [gaussians.for_kernels(), views, depths]
    return ParallelLaunch(skin_kernel, len(gaussians), inputs, device, threads, even=True)
