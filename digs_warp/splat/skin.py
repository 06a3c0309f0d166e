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

from digs_warp.device.elementary import exp_of, larger
from digs_warp.device.kernel_options import group_module_options
from digs_warp.device.parallel import ParallelLaunch
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import ViewParams, rotation_of
from digs_warp.splat.records import (
    GROUP_SIZE,
    GaussianArrays,
    put_vec3,
    put_vec4,
    vec3_at,
    vec4_at,
)

wp.set_module_options(group_module_options())

# [standard deviations] With it, the surface without a depth term is least biased: see docs/training.md.
REACH = 2.0

# A splat as wide as its distance has its skin at this share of the distance, not behind the camera.
_LEAST_SHARE = wp.constant(0.1)
_REACH = wp.constant(REACH)

_GROUP = wp.constant(GROUP_SIZE)
# Where the fields of a group begin in its memory, after the means.
_LOG_SCALES = wp.constant(3 * GROUP_SIZE)
_QUATS = wp.constant(6 * GROUP_SIZE)
_DEPTHS = wp.constant(10 * GROUP_SIZE)
_MEMORY = 11 * GROUP_SIZE


@wp.func
def skin_depth(
    cam: ViewParams, mean: wp.vec3, log_scale: wp.vec3, quat: wp.vec4, depth: float
) -> float:
    """Return the planar depth of a splat's skin [m]; ``depth`` is that of its center."""
    # The length of the ray cancels out.
    ray = mean - cam.center_world
    forward = wp.vec3(cam.rotation[2, 0], cam.rotation[2, 1], cam.rotation[2, 2])
    along = wp.transpose(rotation_of(quat)) * ray
    inverse = wp.vec3(exp_of(-log_scale[0]), exp_of(-log_scale[1]), exp_of(-log_scale[2]))
    ahead = _REACH * wp.dot(ray, forward) / wp.length(wp.cw_mul(along, inverse))
    return larger(depth - ahead, _LEAST_SHARE * depth)


@wp.kernel
def skin_kernel(
    first: int,
    gaussians: GaussianArrays,
    views: wp.array[ViewParams],  # [1]
    depths: wp.array[
        float
    ],  # [n] planar depth of the centers, 0 if not drawn; then of the skins [m]
):
    """Move the depths of ``GROUP_SIZE`` splats from their centers to their skins."""
    begin = (first + wp.tid()) * _GROUP
    size = wp.min(_GROUP, depths.shape[0] - begin)
    cam = views[0]
    memory = wp.zeros(shape=(wp.static(_MEMORY),), dtype=float)
    # A view: LLVM reloads the address of the local array itself after every write.
    state = wp.array(ptr=memory.ptr, shape=(wp.static(_MEMORY),), dtype=float)
    for member in range(size):
        given = begin + member
        put_vec3(gaussians.means[given], state, member)
        put_vec3(gaussians.log_scales[given], state, _LOG_SCALES + member)
        put_vec4(gaussians.quats[given], state, _QUATS + member)
        state[_DEPTHS + member] = depths[given]
    for i in range(_GROUP):
        mean, log_scale = vec3_at(state, i), vec3_at(state, _LOG_SCALES + i)
        quat, depth = vec4_at(state, _QUATS + i), state[_DEPTHS + i]
        skin = skin_depth(cam, mean, log_scale, quat, depth)
        state[_DEPTHS + i] = wp.where(depth > 0.0, skin, depth)
    for out in range(size):
        depths[begin + out] = state[_DEPTHS + out]


def skin_launch(
    gaussians: DeviceGaussians, views: wp.array, depths: wp.array, device: str, threads: int
) -> ParallelLaunch:
    """Return what moves the depths of the centers to those of the skins, in place."""
    inputs = [gaussians.for_kernels(), views, depths]
    groups = -(-len(gaussians) // GROUP_SIZE)
    return ParallelLaunch(skin_kernel, groups, inputs, device, threads, even=True)
