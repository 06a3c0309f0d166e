"""`digs_warp.splat.project.project_kernel` for CPUs: LLVM projects the Gaussians of a group at once.

A group is laid out field by field in local memory, projected in one loop of vector code, and written splat
by splat.
"""

import warp as wp

from digs_warp.device.kernel_options import unfused_module_options
from digs_warp.splat.project import color_is_finite, projection_of, put_color, put_record
from digs_warp.splat.records import (
    GROUP_PARAMETERS,
    GROUP_SIZE,
    SPLAT_FIELDS,
    GaussianArrays,
    Splats,
    parameters_at,
    put_parameters,
    put_vec4,
    vec4_at,
)

# Neither fused nor reordered: the determinant of a needle is a small difference of large products.
wp.set_module_options(unfused_module_options())

_GROUP = wp.constant(GROUP_SIZE)
_RECORD = wp.constant(SPLAT_FIELDS)
# Where the fields of a group begin in its memory: first those of the records, by number, then these.
_Z = wp.constant(SPLAT_FIELDS * GROUP_SIZE)
_DEPTH = wp.constant((SPLAT_FIELDS + 1) * GROUP_SIZE)
_DRAWN = wp.constant((SPLAT_FIELDS + 2) * GROUP_SIZE)
_BOX = wp.constant((SPLAT_FIELDS + 3) * GROUP_SIZE)
_PARAMETERS = wp.constant((SPLAT_FIELDS + 7) * GROUP_SIZE)
_MEMORY = (SPLAT_FIELDS + 7 + GROUP_PARAMETERS) * GROUP_SIZE


@wp.kernel
def project_group_kernel(
    first: int,
    gaussians: GaussianArrays,
    degree: int,
    splats: Splats,
):
    """Project ``GROUP_SIZE`` Gaussians; the arguments are those of `project_kernel`."""
    begin = (first + wp.tid()) * _GROUP
    size = wp.min(_GROUP, gaussians.means.shape[0] - begin)
    cam = splats.views[0]
    memory = wp.zeros(shape=(wp.static(_MEMORY),), dtype=float)
    # A view: LLVM reloads the address of the local array itself after every write.
    state = wp.array(ptr=memory.ptr, shape=(wp.static(_MEMORY),), dtype=float)
    for member in range(size):
        given = begin + member
        put_parameters(
            gaussians.means[given],
            gaussians.log_scales[given],
            gaussians.quats[given],
            gaussians.opacity_logits[given],
            state,
            _PARAMETERS + member,
        )
    # Padding slots compute on zeros and are discarded.
    for i in range(_GROUP):
        mean, log_scale, quat, opacity_logit = parameters_at(state, _PARAMETERS + i)
        p = projection_of(cam, mean, log_scale, quat, opacity_logit)
        put_record(p, state, i, _GROUP)
        state[_Z + i] = p.z
        state[_DEPTH + i] = p.depth
        state[_DRAWN + i] = float(p.drawn)
        # Numbers of tiles are small: exact as floats.
        box = wp.vec4(float(p.box[0]), float(p.box[1]), float(p.box[2]), float(p.box[3]))
        put_vec4(box, state, _BOX + i)
    for out in range(size):
        g = begin + out
        splats.boxes[g] = wp.vec4i(0, 0, 0, 0)
        splats.centers[g] = 0.0
        if state[_DRAWN + out] != 0.0 and color_is_finite(gaussians.sh, g, degree):
            for field in range(_RECORD):
                splats.records[g, field] = state[field * _GROUP + out]
            put_color(cam, g, gaussians.means[g], gaussians.sh, degree, splats.records)
            splats.centers[g] = state[_Z + out]
            splats.depths[g] = state[_DEPTH + out]
            tiles = vec4_at(state, _BOX + out)
            splats.boxes[g] = wp.vec4i(int(tiles[0]), int(tiles[1]), int(tiles[2]), int(tiles[3]))
