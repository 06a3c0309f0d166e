"""`digs_warp.splat.shape_gradient.project_backward_kernel` for CPUs: LLVM pulls a group back at once.

As in `digs_warp.splat.project_group`, a group is laid out field by field in local memory. Sums over tiles and
the color go splat by splat: their loops have other lengths.
"""

import warp as wp

from digs_warp.device.kernel_options import group_module_options
from digs_warp.splat.footprint import footprint_of
from digs_warp.splat.records import (
    GROUP_PARAMETERS,
    GROUP_SIZE,
    GaussianArrays,
    PairGradients,
    Splats,
    StatisticsArrays,
    parameters_at,
    put_parameters,
    put_vec3,
    vec3_at,
)
from digs_warp.splat.shape_gradient import (
    SplatGradient,
    add_statistics,
    color_gradient,
    conic_of,
    gather,
    put_zeros,
    shape_gradient,
)

wp.set_module_options(group_module_options())

_GROUP = wp.constant(GROUP_SIZE)
# Where the fields of a group begin in its memory: first the parameters, which make room for their gradients.
_CONIC = wp.constant(GROUP_PARAMETERS * GROUP_SIZE)
_D_U = wp.constant((GROUP_PARAMETERS + 3) * GROUP_SIZE)
_D_V = wp.constant((GROUP_PARAMETERS + 4) * GROUP_SIZE)
_D_CONIC = wp.constant((GROUP_PARAMETERS + 5) * GROUP_SIZE)
_D_OPACITY = wp.constant((GROUP_PARAMETERS + 8) * GROUP_SIZE)
_D_DEPTH = wp.constant((GROUP_PARAMETERS + 9) * GROUP_SIZE)
_D_COLOR = wp.constant((GROUP_PARAMETERS + 10) * GROUP_SIZE)
_MEMORY = (GROUP_PARAMETERS + 13) * GROUP_SIZE


@wp.kernel
def project_backward_group_kernel(
    first: int,
    gaussians: GaussianArrays,
    degree: int,
    splats: Splats,
    pairs: PairGradients,
    # outputs
    adjoint: GaussianArrays,
    statistics: StatisticsArrays,
):
    """Pull ``GROUP_SIZE`` splats back; the arguments are those of `project_backward_kernel`."""
    begin = (first + wp.tid()) * _GROUP
    size = wp.min(_GROUP, gaussians.means.shape[0] - begin)
    cam = splats.views[0]
    memory = wp.zeros(shape=(wp.static(_MEMORY),), dtype=float)
    # A view: LLVM reloads the address of the local array itself after every write.
    state = wp.array(ptr=memory.ptr, shape=(wp.static(_MEMORY),), dtype=float)
    for member in range(size):
        g = begin + member
        put_parameters(
            gaussians.means[g],
            gaussians.log_scales[g],
            gaussians.quats[g],
            gaussians.opacity_logits[g],
            state,
            member,
        )
        put_vec3(conic_of(splats.records, g), state, _CONIC + member)
        d = gather(pairs.starts[g], pairs.starts[g + 1], pairs)
        state[_D_U + member] = d.u
        state[_D_V + member] = d.v
        put_vec3(wp.vec3(d.a, d.b, d.c), state, _D_CONIC + member)
        state[_D_OPACITY + member] = d.opacity
        state[_D_DEPTH + member] = d.depth
        put_vec3(d.color, state, _D_COLOR + member)
    # Padding slots compute on zeros and are discarded.
    for i in range(_GROUP):
        mean, log_scale, q, opacity_logit = parameters_at(state, i)
        f = footprint_of(cam, mean, log_scale, q)
        pulled = SplatGradient()
        pulled.u = state[_D_U + i]
        pulled.v = state[_D_V + i]
        pulled.a = state[_D_CONIC + i]
        pulled.b = state[_D_CONIC + _GROUP + i]
        pulled.c = state[_D_CONIC + 2 * _GROUP + i]
        pulled.opacity = state[_D_OPACITY + i]
        pulled.depth = state[_D_DEPTH + i]
        s = shape_gradient(cam, f, q, opacity_logit, vec3_at(state, _CONIC + i), pulled)
        d_mean = wp.transpose(cam.rotation) * s.point
        put_parameters(d_mean, s.log_scale, s.quat, s.opacity_logit, state, i)
    for out in range(size):
        g = begin + out
        if pairs.starts[g] == pairs.starts[g + 1]:
            put_zeros(g, adjoint)
        else:
            d_color = vec3_at(state, _D_COLOR + out)
            d_offset = color_gradient(
                cam, g, gaussians, degree, splats.records, d_color, adjoint.sh
            )
            d_center, d_log_scale, d_quat, d_logit = parameters_at(state, out)
            adjoint.means[g] = d_center + d_offset
            adjoint.log_scales[g] = d_log_scale
            adjoint.quats[g] = d_quat
            adjoint.opacity_logits[g] = d_logit
            if statistics.counts.shape[0] > 0:
                add_statistics(cam, g, state[_D_U + out], state[_D_V + out], statistics)
