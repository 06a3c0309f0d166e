"""`digs_warp.splat.bin_kernels.span_kernel` for CPUs: LLVM finds a span of each splat of a group at once."""

import warp as wp

from digs_warp.device.kernel_options import unfused_module_options
from digs_warp.splat.bin_kernels import columns_in_row, drawn_columns, outline_of
from digs_warp.splat.footprint import ViewParams
from digs_warp.splat.records import (
    GROUP_SIZE,
    SPLAT_A,
    SPLAT_B,
    SPLAT_C,
    SPLAT_HALF_HEIGHT,
    SPLAT_HALF_WIDTH,
    SPLAT_TAU,
    SPLAT_U,
    SPLAT_V,
    put_vec4,
    vec3_at,
    vec4_at,
)
from digs_warp.splat.spans import span_of

# Not fused: `span_kernel` has the same bits.
wp.set_module_options(unfused_module_options())

_GROUP = wp.constant(GROUP_SIZE)
# What is copied of a record, and where it lies in the memory of a group.
_FIELDS = (
    *(SPLAT_U, SPLAT_V, SPLAT_HALF_WIDTH, SPLAT_HALF_HEIGHT),
    *(SPLAT_A, SPLAT_B, SPLAT_C, SPLAT_TAU),
)
_V = wp.constant(GROUP_SIZE)
_HALF_WIDTH = wp.constant(2 * GROUP_SIZE)
_HALF_HEIGHT = wp.constant(3 * GROUP_SIZE)
_CONIC = wp.constant(4 * GROUP_SIZE)
_TAU = wp.constant(7 * GROUP_SIZE)
# Behind it: what all spans of a splat follow from.
_OUTLINE = wp.constant(8 * GROUP_SIZE)
_MEMORY = 12 * GROUP_SIZE
# Whole numbers: how many rows a splat has, then these.
_TOP_ROW = wp.constant(GROUP_SIZE)
_SPAN = wp.constant(2 * GROUP_SIZE)
_BEFORE = wp.constant(3 * GROUP_SIZE)
_PAIRS = wp.constant(4 * GROUP_SIZE)
_START = wp.constant(5 * GROUP_SIZE)
_PLACE = wp.constant(6 * GROUP_SIZE)
_WHOLE = 7 * GROUP_SIZE


# Finding each number in a Warp array would take longer than to copy it.
_TAKE = "const float* record = splats.data + g * (splats.strides[0] >> 2);\n" + "\n".join(
    f"state.data[member + {place * GROUP_SIZE}] = record[{int(field)}];"
    for place, field in enumerate(_FIELDS)
)


@wp.func_native(_TAKE)
def take_ellipse(splats: wp.array2d[float], g: int, state: wp.array[float], member: int):
    """Write the ellipse of a splat into its group."""
    ...


@wp.kernel
def span_group_kernel(
    first: int,
    views: wp.array[ViewParams],
    splats: wp.array2d[float],
    first_tile_rows: wp.array[int],
    row_starts: wp.array[int],
    slack: float,
    # outputs
    spans: wp.array[wp.vec2i],
    pair_counts: wp.array[int],
):
    """Find the spans of ``GROUP_SIZE`` splats; the arguments are those of `span_kernel`."""
    begin = (first + wp.tid()) * _GROUP
    size = wp.min(_GROUP, pair_counts.shape[0] - begin)
    drawn = drawn_columns(views[0])
    memory = wp.zeros(shape=(wp.static(_MEMORY),), dtype=float)
    numbers = wp.zeros(shape=(wp.static(_WHOLE),), dtype=int)
    # Views: LLVM reloads the address of a local array itself after every write.
    state = wp.array(ptr=memory.ptr, shape=(wp.static(_MEMORY),), dtype=float)
    whole = wp.array(ptr=numbers.ptr, shape=(wp.static(_WHOLE),), dtype=int)
    most = int(0)
    for member in range(size):
        g = begin + member
        start = row_starts[g]
        rows = row_starts[g + 1] - start
        # A splat without rows computes on zeros, which are discarded.
        if rows > 0:
            whole[member] = rows
            whole[_TOP_ROW + member] = first_tile_rows[g]
            whole[_START + member] = start
            take_ellipse(splats, g, state, member)
            most = wp.max(most, rows)
    for i in range(_GROUP):
        half_size = wp.vec2(state[_HALF_WIDTH + i], state[_HALF_HEIGHT + i])
        conic = vec3_at(state, _CONIC + i)
        put_vec4(outline_of(conic, state[_TAU + i], half_size), state, _OUTLINE + i)
    # A splat with fewer rows finds its last one again: a condition on rows would be hard to predict.
    for row in range(most):
        for j in range(_GROUP):
            center = wp.vec2(state[j], state[_V + j])
            half = wp.vec2(state[_HALF_WIDTH + j], state[_HALF_HEIGHT + j])
            outline = vec4_at(state, _OUTLINE + j)
            own_row = wp.min(row, whole[j] - 1)
            tile_row = whole[_TOP_ROW + j] + own_row
            touched = columns_in_row(center, half, outline, tile_row, slack, drawn)
            pairs = touched[1] - touched[0]
            before = whole[_PAIRS + j] - wp.where(own_row < row, pairs, 0)
            whole[_PLACE + j] = whole[_START + j] + own_row
            whole[_SPAN + j] = span_of(touched[0], touched[1])
            whole[_BEFORE + j] = before
            whole[_PAIRS + j] = before + pairs
        for out in range(size):
            if whole[out] > 0:
                span = wp.vec2i(whole[_SPAN + out], whole[_BEFORE + out])
                spans[whole[_PLACE + out]] = span
    for last in range(size):
        pair_counts[begin + last] = wp.where(whole[last] > 0, whole[_PAIRS + last], 0)
