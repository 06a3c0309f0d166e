# type: ignore
# (device code, which Warp's stubs do not type)
"""`digs_warp.splat.project.project_kernel` for CPUs: LLVM projects the Gaussians of a group at once.

A group is laid out field by field in local memory, projected in one loop of vector code, and written splat
by splat.
"""

import warp as wp

from digs_warp.splat.footprint import ViewParams, facing_normal, footprint_of
from digs_warp.splat.project import color_is_finite, projection_of, put_color, put_record
from digs_warp.splat.records import SPLAT_FIELDS

_flags = ["-march=native", "-ffp-contract=off"]
# A loop with calls is not vectorized, and the projection is longer than what LLVM inlines by itself.
_flags.append("-mllvm=-inline-threshold=9000")
# Neither fused nor reordered: the determinant of a needle is a small difference of large products.
wp.set_module_options(
    {
        "enable_backward": False,
        "max_unroll": 1,
        "optimization_level": 3,
        "cpu_compiler_flags": " ".join(_flags),
    }
)

# Gaussians that are projected at once.
PROJECT_GROUP = 16

_GROUP = wp.constant(PROJECT_GROUP)
_RECORD = wp.constant(SPLAT_FIELDS)
# Where the fields of a group begin in its memory: first those of the records, by number, then these.
_Z = wp.constant(SPLAT_FIELDS * PROJECT_GROUP)
_DRAWN = wp.constant((SPLAT_FIELDS + 1) * PROJECT_GROUP)
_TOP = wp.constant((SPLAT_FIELDS + 2) * PROJECT_GROUP)
_BOTTOM = wp.constant((SPLAT_FIELDS + 3) * PROJECT_GROUP)
_MEAN = wp.constant((SPLAT_FIELDS + 4) * PROJECT_GROUP)
_LOG_SCALE = wp.constant((SPLAT_FIELDS + 7) * PROJECT_GROUP)
_QUAT = wp.constant((SPLAT_FIELDS + 10) * PROJECT_GROUP)
_LOGIT = wp.constant((SPLAT_FIELDS + 14) * PROJECT_GROUP)
_MEMORY = (SPLAT_FIELDS + 15) * PROJECT_GROUP


@wp.func
def vec3_at(state: wp.array[float], first: int) -> wp.vec3:
    """Vector whose components lie a group apart."""
    return wp.vec3(state[first], state[first + _GROUP], state[first + 2 * _GROUP])


@wp.func
def put_vec3(value: wp.vec3, state: wp.array[float], first: int):
    """Write what `vec3_at` reads."""
    state[first] = value[0]
    state[first + _GROUP] = value[1]
    state[first + 2 * _GROUP] = value[2]


@wp.kernel
def project_group_kernel(
    first: int,
    views: wp.array[ViewParams],
    means: wp.array[wp.vec3],
    log_scales: wp.array[wp.vec3],
    quats: wp.array[wp.vec4],
    opacity_logits: wp.array[float],
    coefficients: wp.array2d[wp.vec3],
    degree: int,
    # outputs
    splats: wp.array2d[float],
    depths: wp.array[float],
    first_tile_rows: wp.array[int],
    row_counts: wp.array[int],
    normals: wp.array[wp.vec3],
):
    """Project ``PROJECT_GROUP`` Gaussians; the arguments are those of `project_kernel`."""
    begin = (first + wp.tid()) * _GROUP
    size = wp.min(_GROUP, means.shape[0] - begin)
    cam = views[0]
    memory = wp.zeros(shape=(wp.static(_MEMORY),), dtype=float)
    # A view: of the local array itself, LLVM reads the address anew after every write.
    state = wp.array(ptr=memory.ptr, shape=(wp.static(_MEMORY),), dtype=float)
    for member in range(size):
        put_vec3(means[begin + member], state, _MEAN + member)
        put_vec3(log_scales[begin + member], state, _LOG_SCALE + member)
        quat = quats[begin + member]
        put_vec3(wp.vec3(quat[0], quat[1], quat[2]), state, _QUAT + member)
        state[_QUAT + 3 * _GROUP + member] = quat[3]
        state[_LOGIT + member] = opacity_logits[begin + member]
    # Of a group that is not full, the rest is zeros; what becomes of them is not written.
    for i in range(_GROUP):
        axis = vec3_at(state, _QUAT + i)
        p = projection_of(
            cam,
            vec3_at(state, _MEAN + i),
            vec3_at(state, _LOG_SCALE + i),
            wp.vec4(axis[0], axis[1], axis[2], state[_QUAT + 3 * _GROUP + i]),
            state[_LOGIT + i],
        )
        put_record(p, state, i, _GROUP)
        # Tile rows are small whole numbers: exact as floats.
        state[_Z + i] = p.z
        state[_DRAWN + i] = float(p.drawn)
        state[_TOP + i] = float(p.top_row)
        state[_BOTTOM + i] = float(p.bottom_row)
    for out in range(size):
        g = begin + out
        row_counts[g] = 0
        depths[g] = 0.0
        if state[_DRAWN + out] != 0.0 and color_is_finite(coefficients, g, degree):
            for field in range(_RECORD):
                splats[g, field] = state[field * _GROUP + out]
            put_color(cam, g, means[g], coefficients, degree, splats)
            depths[g] = state[_Z + out]
            first_tile_rows[g] = int(state[_TOP + out])
            row_counts[g] = int(state[_BOTTOM + out]) - int(state[_TOP + out]) + 1
            if normals.shape[0] > 0:
                normals[g] = facing_normal(footprint_of(cam, means[g], log_scales[g], quats[g]))
