# Warp's stubs do not type device code:
# pyright: reportAttributeAccessIssue=false, reportOperatorIssue=false, reportGeneralTypeIssues=false
# pyright: reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportOptionalOperand=false, reportReturnType=false
"""One level of a plane sweep, in tiles: how well photographs match at a few depths of each pixel.

A pixel x of a reference image at inverse depth q lies in a neighbor's image at

    x' ~ A x + q b,    A = K' R K^-1,    b = K' t        (R, t: the neighbor's camera from the reference)

For each of k inverse depths q0 + i step, with q0 of each pixel, a window of 7x7 pixels is compared with each
neighbor by the normalized cross-correlation

    (E[r s] - E[r] E[s]) / sqrt((var r + noise) (var s + noise))

The better half of the neighbors counts, for the others may not see the surface; the mean of this in 5x5
pixels is the score. A parabola through the scores beside the best one refines its inverse depth; where it is
the first or the last one, there is none. (Collins, CVPR 1996; the better half: Kang et al., CVPR 2001.)

The samples of a neighbor are bilinear: its four pixels lie in one integer, so that one load fetches all.
"""

import warp as wp

from digs_warp.device.elementary import larger, smaller
from digs_warp.device.kernel_options import vector_module_options

wp.set_module_options(vector_module_options())

# Neighbors that a view is compared with, at most.
NEIGHBORS = 4
# Pixels around one that its correlation and its score look at.
WINDOW_RADIUS, SCORE_RADIUS = 3, 2
# Variance of noise and rounding [8-bit values squared]: without it, plain walls would match one another.
NOISE = 4.0
# Score of what has none.
NO_SCORE = -1.0

# Pixels of a tile, and those around it that are sampled; rows are padded to whole vectors.
TILE_WIDTH, TILE_HEIGHT = 64, 32
HALO = WINDOW_RADIUS + SCORE_RADIUS
PITCH = 80
SAMPLED_ROWS = TILE_HEIGHT + 2 * HALO
SCORED_ROWS = TILE_HEIGHT + 2 * SCORE_RADIUS
# Where the planes of a tile begin in its memory.
REFERENCE = 0
START = REFERENCE + SAMPLED_ROWS * PITCH
SAMPLES = START + SAMPLED_ROWS * PITCH
MEANS = SAMPLES + SAMPLED_ROWS * PITCH
SPREADS = MEANS + SCORED_ROWS * PITCH
BEST_MATCH = SPREADS + SCORED_ROWS * PITCH
NEXT_MATCH = BEST_MATCH + SCORED_ROWS * PITCH
SUMS = NEXT_MATCH + SCORED_ROWS * PITCH  # of s, of s^2, of r s in the columns of a window
SUM_PITCH = PITCH + 16
BEST = SUMS + 3 * SUM_PITCH
NUMBER = BEST + TILE_HEIGHT * TILE_WIDTH
BEFORE = NUMBER + TILE_HEIGHT * TILE_WIDTH
AFTER = BEFORE + TILE_HEIGHT * TILE_WIDTH
LAST = AFTER + TILE_HEIGHT * TILE_WIDTH
MEMORY = LAST + TILE_HEIGHT * TILE_WIDTH

_WIDTH, _HEIGHT = wp.constant(TILE_WIDTH), wp.constant(TILE_HEIGHT)
_HALO, _PITCH = wp.constant(HALO), wp.constant(PITCH)
_SAMPLED, _SCORED = wp.constant(SAMPLED_ROWS), wp.constant(SCORED_ROWS)
_START, _SAMPLES = wp.constant(START), wp.constant(SAMPLES)
_MEANS, _SPREADS = wp.constant(MEANS), wp.constant(SPREADS)
_BEST_MATCH, _NEXT_MATCH = wp.constant(BEST_MATCH), wp.constant(NEXT_MATCH)
_SUMS, _SUM_PITCH = wp.constant(SUMS), wp.constant(SUM_PITCH)
_BEST, _NUMBER, _BEFORE = wp.constant(BEST), wp.constant(NUMBER), wp.constant(BEFORE)
_AFTER, _LAST = wp.constant(AFTER), wp.constant(LAST)
_WINDOW = wp.constant(2 * WINDOW_RADIUS + 1)
_SHARE = wp.constant(1.0 / (2 * WINDOW_RADIUS + 1) ** 2)
_SCORE_SHARE = wp.constant(1.0 / (2 * SCORE_RADIUS + 1) ** 2)
_NOISE, _NO_SCORE = wp.constant(NOISE), wp.constant(NO_SCORE)
# Values are counted from here: their squares are smaller, and their sums more exact.
_MIDDLE = wp.constant(128.0)
# A neighbor's camera has the point behind it: it lies outside of its image, far away.
_LEAST_DEPTH = wp.constant(1e-6)
# No index is negative: it need not be looked at.
_INDEX = wp.constant(0x7FFFFFFF)


@wp.struct
class SweptView:
    """A view as the kernel knows it: where its pixels begin in the arrays of all views, and what is tried."""

    start: int
    width: int
    height: int
    step: float  # between two inverse depths [1/unit]
    count: int  # of inverse depths


@wp.struct
class SweptPair:
    """A neighbor of a view, and what takes the reference's pixels there."""

    view: int
    turned: wp.mat33  # A
    shift: wp.vec3  # b


@wp.func
def place(x: float, most: float) -> float:
    """Hold a pixel within an image; NaN is at 0."""
    return larger(smaller(x, most), 0.0)


@wp.func
def sample(packed: wp.array[int], u: float, v: float, width: int) -> float:
    """Bilinear value at a place inside of the image."""
    column, row = int(u), int(v)
    fu, fv = u - float(column), v - float(row)
    four = packed[(row * width + column) & _INDEX]
    a, b = float(four & 255), float((four >> 8) & 255)
    c, d = float((four >> 16) & 255), float((four >> 24) & 255)
    upper = a + fu * (b - a)
    return upper + fv * (c + fu * (d - c) - upper)


@wp.func
def window_sum(state: wp.array[float], first: int) -> float:
    """Sum of the seven values from ``first`` on."""
    left = state[first] + state[first + 1] + state[first + 2]
    right = state[first + 4] + state[first + 5] + state[first + 6]
    return left + state[first + 3] + right


@wp.func
def add_row(state: wp.array[float], row: int, sign: float):
    """Add a row to the sums of the columns of a window, or with -1 take it out."""
    at = row * _PITCH
    for x in range(_PITCH):
        s = state[_SAMPLES + at + x]
        signed = sign * s
        state[_SUMS + x] = state[_SUMS + x] + signed
        state[_SUMS + _SUM_PITCH + x] = state[_SUMS + _SUM_PITCH + x] + signed * s
        state[_SUMS + 2 * _SUM_PITCH + x] = (
            state[_SUMS + 2 * _SUM_PITCH + x] + signed * state[at + x]
        )


@wp.kernel
def sweep_kernel(
    first: int,
    tiles: wp.array[wp.vec2i],  # first column, first row
    views: wp.array[SweptView],  # the one that is swept, then others
    pairs: wp.array[SweptPair],
    packed: wp.array[int],  # four 8-bit pixels each: this one, the right one, and those below
    starts: wp.array[float],  # q0 of each pixel of the view
    # outputs
    found: wp.array[float],  # the best inverse depth
    scores: wp.array[float],  # its score, or `NO_SCORE`
):
    """Sweep one tile of the first view."""
    tile = tiles[first + wp.tid()]
    view = views[0]
    memory = wp.zeros(shape=(wp.static(MEMORY),), dtype=float)
    # A view: LLVM reloads the address of the local array itself after every write.
    state = wp.array(ptr=memory.ptr, shape=(wp.static(MEMORY),), dtype=float)
    last_column, last_row = view.width - 1, view.height - 1
    for y_in in range(_SAMPLED):
        row_in = wp.clamp(tile[1] + y_in - _HALO, 0, last_row) * view.width
        for x_in in range(_PITCH):
            pixel = row_in + wp.clamp(tile[0] + x_in - _HALO, 0, last_column)
            state[y_in * _PITCH + x_in] = float(packed[view.start + pixel] & 255) - _MIDDLE
            state[_START + y_in * _PITCH + x_in] = starts[pixel]
    for at_best in range(_HEIGHT * _WIDTH):
        state[_BEST + at_best] = -2.0
    # Mean and inverse deviation of the reference in each window.
    for y_ref in range(_SCORED):
        for x_sum in range(_PITCH):
            state[_SUMS + x_sum] = 0.0
            state[_SUMS + _SUM_PITCH + x_sum] = 0.0
        for i_ref in range(_WINDOW):
            at_ref = (y_ref + i_ref) * _PITCH
            for x_add in range(_PITCH):
                r_add = state[at_ref + x_add]
                state[_SUMS + x_add] = state[_SUMS + x_add] + r_add
                state[_SUMS + _SUM_PITCH + x_add] = (
                    state[_SUMS + _SUM_PITCH + x_add] + r_add * r_add
                )
        for x_ref in range(_PITCH):
            mean = _SHARE * window_sum(state, _SUMS + x_ref)
            square = _SHARE * window_sum(state, _SUMS + _SUM_PITCH + x_ref)
            spread = larger(square - mean * mean, 0.0) + _NOISE
            state[_MEANS + y_ref * _PITCH + x_ref] = mean
            state[_SPREADS + y_ref * _PITCH + x_ref] = 1.0 / wp.sqrt(spread)
    for number in range(view.count):
        offset = float(number) * view.step
        for at_match in range(_SCORED * _PITCH):
            state[_BEST_MATCH + at_match] = _NO_SCORE
            state[_NEXT_MATCH + at_match] = _NO_SCORE
        for p in range(pairs.shape[0]):
            pair = pairs[p]
            other = views[pair.view]
            pixels = wp.array(
                ptr=packed.ptr + wp.uint64(4) * wp.uint64(other.start),
                shape=(other.width * other.height,),
                dtype=int,
            )
            width = other.width
            # The last whole pixel has its right and lower one beside it.
            most_u, most_v = float(other.width) - 1.001, float(other.height) - 1.001
            turned, shift = pair.turned, pair.shift
            for y in range(_SAMPLED):
                py = float(wp.clamp(tile[1] + y - _HALO, 0, last_row))
                u_row = turned[0, 1] * py + turned[0, 2]
                v_row = turned[1, 1] * py + turned[1, 2]
                z_row = turned[2, 1] * py + turned[2, 2]
                to = y * _PITCH
                for x in range(_PITCH):
                    px = place(float(tile[0] + x - _HALO), float(last_column))
                    q = state[_START + to + x] + offset
                    z = larger(turned[2, 0] * px + z_row + q * shift[2], _LEAST_DEPTH)
                    near = 1.0 / z
                    u = place((turned[0, 0] * px + u_row + q * shift[0]) * near, most_u)
                    v = place((turned[1, 0] * px + v_row + q * shift[1]) * near, most_v)
                    state[_SAMPLES + to + x] = sample(pixels, u, v, width) - _MIDDLE
            for at_zero in range(wp.static(3 * SUM_PITCH)):
                state[_SUMS + at_zero] = 0.0
            for y_new in range(_SAMPLED):
                add_row(state, y_new, 1.0)
                if y_new >= _WINDOW - 1:
                    y_out = y_new - (_WINDOW - 1)
                    at_out = y_out * _PITCH
                    for x_out in range(_PITCH):
                        r_mean = state[_MEANS + at_out + x_out]
                        s_mean = _SHARE * window_sum(state, _SUMS + x_out)
                        s_square = _SHARE * window_sum(state, _SUMS + _SUM_PITCH + x_out)
                        rs_mean = _SHARE * window_sum(state, _SUMS + 2 * _SUM_PITCH + x_out)
                        s_spread = larger(s_square - s_mean * s_mean, 0.0) + _NOISE
                        match = (rs_mean - r_mean * s_mean) / wp.sqrt(s_spread)
                        match = match * state[_SPREADS + at_out + x_out]
                        best_match = state[_BEST_MATCH + at_out + x_out]
                        state[_NEXT_MATCH + at_out + x_out] = larger(
                            state[_NEXT_MATCH + at_out + x_out], smaller(best_match, match)
                        )
                        state[_BEST_MATCH + at_out + x_out] = larger(best_match, match)
                    add_row(state, y_out, -1.0)  # the window moves on
        # Of one or two neighbors the better one, else the mean of the better two.
        half = wp.where(pairs.shape[0] > 2, 0.5, 0.0)
        for at_both in range(_SCORED * _PITCH):
            better_one = state[_BEST_MATCH + at_both]
            state[_BEST_MATCH + at_both] = better_one + half * (
                state[_NEXT_MATCH + at_both] - better_one
            )
        for y_score in range(_HEIGHT):
            at_score = _BEST_MATCH + y_score * _PITCH
            for x_five in range(_PITCH):
                five = state[at_score + x_five] + state[at_score + _PITCH + x_five]
                five += (
                    state[at_score + 2 * _PITCH + x_five] + state[at_score + 3 * _PITCH + x_five]
                )
                state[_SUMS + x_five] = five + state[at_score + 4 * _PITCH + x_five]
            at_row = y_score * _WIDTH
            for x_score in range(_WIDTH):
                left = state[_SUMS + x_score] + state[_SUMS + x_score + 1]
                right = state[_SUMS + x_score + 3] + state[_SUMS + x_score + 4]
                score = _SCORE_SHARE * (left + state[_SUMS + x_score + 2] + right)
                at = at_row + x_score
                best = state[_BEST + at]
                last = state[_LAST + at]
                is_next = state[_NUMBER + at] == float(number - 1)
                after = wp.where(is_next, score, state[_AFTER + at])
                is_better = score > best
                state[_BEFORE + at] = wp.where(is_better, last, state[_BEFORE + at])
                state[_AFTER + at] = wp.where(is_better, score, after)
                state[_NUMBER + at] = wp.where(is_better, float(number), state[_NUMBER + at])
                state[_BEST + at] = wp.where(is_better, score, best)
                state[_LAST + at] = score
    for y_end in range(wp.min(_HEIGHT, view.height - tile[1])):
        for x_end in range(wp.min(_WIDTH, view.width - tile[0])):
            at_end = y_end * _WIDTH + x_end
            chosen = state[_NUMBER + at_end]
            top = state[_BEST + at_end]
            curve = state[_BEFORE + at_end] - 2.0 * top + state[_AFTER + at_end]
            is_inner = chosen > 0.0 and chosen < float(view.count - 1) and curve < 0.0
            tilt = state[_BEFORE + at_end] - state[_AFTER + at_end]
            shifted = wp.where(is_inner, 0.5 * tilt / curve, 0.0)
            pixel_end = (tile[1] + y_end) * view.width + tile[0] + x_end
            found[pixel_end] = starts[pixel_end] + (chosen + shifted) * view.step
            scores[pixel_end] = wp.where(is_inner, top, _NO_SCORE)
