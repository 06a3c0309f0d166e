"""A group of Gaussians in local memory, field by field: LLVM works on all of a group at once.

Component c of a field lies c groups after the field's first component, one member after the other.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

GROUP_FLAGS = "-march=native -mllvm=-inline-threshold=9000"
# Of modules with a loop over a group: one with calls is not vectorized, and its body is longer than what LLVM
# inlines by itself.
GROUP_OPTIONS = {
    "enable_backward": False,
    "max_unroll": 1,
    "optimization_level": 3,
    "cpu_compiler_flags": GROUP_FLAGS,
}

# Gaussians in a group.
GROUP_SIZE = 16

_GROUP = wp.constant(GROUP_SIZE)
# Where the parameters lie, after the place at which they begin; and how many fields they are.
_LOG_SCALE = wp.constant(3 * GROUP_SIZE)
_QUAT = wp.constant(6 * GROUP_SIZE)
_LOGIT = wp.constant(10 * GROUP_SIZE)
GROUP_PARAMETERS = 11


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


@wp.func
def vec4_at(state: wp.array[float], first: int) -> wp.vec4:
    """Vector whose components lie a group apart."""
    return wp.vec4(
        state[first],
        state[first + _GROUP],
        state[first + 2 * _GROUP],
        state[first + 3 * _GROUP],
    )


@wp.func
def put_vec4(value: wp.vec4, state: wp.array[float], first: int):
    """Write what `vec4_at` reads."""
    state[first] = value[0]
    state[first + _GROUP] = value[1]
    state[first + 2 * _GROUP] = value[2]
    state[first + 3 * _GROUP] = value[3]


@wp.func
def put_parameters(
    mean: wp.vec3,
    log_scale: wp.vec3,
    quat: wp.vec4,
    opacity_logit: float,
    state: wp.array[float],
    first: int,
):
    """Write what shapes a Gaussian; ``first`` is where its group's parameters begin, and its place in it."""
    put_vec3(mean, state, first)
    put_vec3(log_scale, state, first + _LOG_SCALE)
    put_vec4(quat, state, first + _QUAT)
    state[first + _LOGIT] = opacity_logit


@wp.func
def parameters_at(state: wp.array[float], first: int):
    """Return what `put_parameters` wrote, in its order."""
    mean = vec3_at(state, first)
    log_scale = vec3_at(state, first + _LOG_SCALE)
    quat = vec4_at(state, first + _QUAT)
    return mean, log_scale, quat, state[first + _LOGIT]
