"""Semi-global matching of one row: five paths of smoothness, the best disparity, and its checks.

Along a path, the cost of a disparity is its own plus the least of: the same disparity one pixel before, a
neighboring one plus P1, any other plus P2 (Hirschmueller 2008). Here a pixel knows only the 32 disparities
of its blocks; those that the pixel before did not try cost P2. Costs on a path are kept minus their least.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

import numpy as np
import warp as wp

# Cost of a neighboring disparity that the pixel does not try: more than any path can have.
MISSING = 8000

# Disparity is found in sixteenths of a pixel; this means none.
FIXED_POINT = 16
NOT_FOUND = -FIXED_POINT

# Written with Clang's vector types, which compile for any processor: the 32 costs of a pixel are one vector.
_RELAX = r"""
typedef short Costs __attribute__((ext_vector_type(32)));
typedef short Half __attribute__((ext_vector_type(16)));
typedef short Eight __attribute__((vector_size(16)));
typedef short Block __attribute__((ext_vector_type(8), aligned(2)));
const short missing = MISSING;
auto load = [](Costs& costs, const short* source) { __builtin_memcpy(&costs, source, sizeof costs); };
auto store = [](short* target, Costs costs) { __builtin_memcpy(target, &costs, sizeof costs); };
auto min = [](auto a, auto b) { return __builtin_elementwise_min(a, b); };
// The costs of the disparities one below and one above; rotated, but what comes round is never used.
auto one_below = [](Costs costs) -> Costs {
    return __builtin_shufflevector(costs, costs, 31, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15,
        16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30);
};
auto one_above = [](Costs costs) -> Costs {
    return __builtin_shufflevector(costs, costs, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17,
        18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 0);
};
// The least of some costs, in all lanes.
auto least_of = [&](Costs costs) -> Costs {
#ifdef __SSE4_1__
    // Halved until one instruction does the rest, which LLVM does not find by itself.
    const Half half = min(
        __builtin_shufflevector(costs, costs, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15),
        __builtin_shufflevector(costs, costs, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30,
            31));
    const Eight low = __builtin_shufflevector(half, half, 0, 1, 2, 3, 4, 5, 6, 7);
    const Eight high = __builtin_shufflevector(half, half, 8, 9, 10, 11, 12, 13, 14, 15);
    const Eight least = __builtin_ia32_phminposuw128(min(low, high));
    return __builtin_shufflevector(least, least, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
        0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
#else
    return costs - costs + __builtin_reduce_min(costs);
#endif
};
// What a step to the next lower and upper lane costs a pixel with these blocks.
struct Steps { Costs lower, upper; };
auto steps_of = [&](int mine) -> Steps {
    Steps step;
    load(step.lower, steps.data + ((mine >> 28) & 7) * 64);
    load(step.upper, steps.data + ((mine >> 28) & 7) * 64 + 32);
    return step;
};
// What a pixel inherits from one with the same blocks without a large step.
auto relaxed = [&](Costs before, const Steps& step) -> Costs {
    return min(before, min(one_below(before) + step.lower, one_above(before) + step.upper));
};
// What it inherits from one with other blocks (its), whose costs are minus their least. Called so rarely
// that it must not cost the others registers.
auto matched = [&](const short* before, int its, int mine) __attribute__((noinline)) -> Costs {
    short costs[32];
    for (int slot = 0; slot < 4; ++slot) {
        int block = (mine >> (7 * slot)) & 127;
        Block same = missing;
        short below = missing, above = missing;
        for (int other = 0; other < 4; ++other) {
            int found = (its >> (7 * other)) & 127;
            if (found == block) same = *(const Block*)(before + other * 8);
            if (found == block - 1) below = before[other * 8 + 7];
            if (found == block + 1) above = before[other * 8];
        }
        Block lower = __builtin_shufflevector(same, same, 0, 0, 1, 2, 3, 4, 5, 6);
        Block upper = __builtin_shufflevector(same, same, 1, 2, 3, 4, 5, 6, 7, 7);
        lower[0] = below;
        upper[7] = above;
        Block step = min(lower, upper) + (Block)(short)small_step;
        *(Block*)(costs + slot * 8) = min(min(same, (Block)(short)large_step), step);
    }
    Costs result;
    load(result, costs);
    return result;
};
auto inherit = [&](const short* before, int its, int mine, const Steps& step) -> Costs {
    if (__builtin_expect(its != mine, 0))
        return matched(before, its, mine);
    Costs costs;
    load(costs, before);
    return min(relaxed(costs, step), (Costs)(short)large_step);
};
// Go on along a row: ``path`` is above zero by its ``least``. The least of what follows is known before the
// large step is in it: this chain of dependent steps is the longest.
auto go_on = [&](Costs& path, Costs& least, Costs alone, const Steps& step) {
    const Costs near = alone + relaxed(path, step), most = least + (short)large_step;
    path = min(near, alone + most) - least;
    least = min(least_of(near), least_of(alone) + most) - least;
};
"""

_DOWN = r"""
const int* mine = blocks.data + row * width;
const int* upper_row = is_first ? mine : mine - width;
const short* own = costs.data + first_cost;
const int size = width * 32;
// The paths from the upper left, from above and from the upper right.
const short* before = paths.data + first_before;
short* after = paths.data + first_after;
short left[32] __attribute__((aligned(64)));
for (int begin = 0, end; begin < width; begin = end) {
    const int bits = mine[begin];  // of pixels with the same blocks
    for (end = begin + 1; end < width && mine[end] == bits;)
        ++end;
    const Steps step = steps_of(bits);
    Costs from_left = 0, least = 0;
    for (int x = begin; x < end; ++x) {
        Costs alone;
        load(alone, own + x * 32);
        if (x > begin) {
            go_on(from_left, least, alone, step);
        } else {
            from_left = x > 0 ? alone + inherit(left, mine[x - 1], bits, step) : alone;
            least = least_of(from_left);
        }
        Costs a = alone, b = alone, c = alone;
        if (!is_first) {
            if (x > 0)
                a += inherit(before + (x - 1) * 32, upper_row[x - 1], bits, step);
            b += inherit(before + size + x * 32, upper_row[x], bits, step);
            if (x < width - 1)
                c += inherit(before + 2 * size + (x + 1) * 32, upper_row[x + 1], bits, step);
        }
        store(sums.data + first_sum + x * 32, from_left + a + b + c);
        store(after + x * 32, a - least_of(a));
        store(after + size + x * 32, b - least_of(b));
        store(after + 2 * size + x * 32, c - least_of(c));
    }
    store(left, from_left - least);
}
"""

_CHOOSE = r"""
typedef bool Lanes __attribute__((ext_vector_type(32)));
const int* mine = blocks.data + row * width;
const short* own = costs.data + first_cost;
// Of each column of the right eye: the least cost of a match, and its disparity.
short* right_cost = right.data + first_right;
short* right_found = right_cost + width + searched;
// Of each pixel: the costs of the disparities next to the best; both the least where one was not tried.
short* lower_cost = right_found + width + searched;
short* upper_cost = lower_cost + width;
short* result = disparity.data + row * width;
for (int i = 0; i < width + searched; ++i) {
    right_cost[i] = 32767;
    right_found[i] = -1;
}
short from_right[32] __attribute__((aligned(64)));
short total[34] = {};  // one more at either end
// Which lanes of a vector of true and false are true, one bit each.
auto bits_of = [](Costs is_true) {
    const Lanes lanes = __builtin_convertvector(is_true, Lanes);
    unsigned bits;
    __builtin_memcpy(&bits, &lanes, 4);
    return bits;
};
auto lanes_of = [](unsigned bits) -> Costs {
    Lanes lanes;
    __builtin_memcpy(&lanes, &bits, 4);
    return -__builtin_convertvector(lanes, Costs);
};
for (int end = width, begin; end > 0; end = begin) {
    const int bits = mine[end - 1];  // of pixels with the same blocks
    for (begin = end - 1; begin > 0 && mine[begin - 1] == bits;)
        --begin;
    const Steps step = steps_of(bits);
    // Whether the disparity above that of a lane is in the next lane: always within a block.
    const unsigned together = bits >> 28;
    const unsigned steps_up = 0x7f7f7f7f | (together & 1) << 7 | (together & 2) << 14 | (together & 4) << 21;
    Costs path = 0, least_path = 0;
    for (int x = end - 1; x >= begin; --x) {
        Costs alone, sum;
        load(alone, own + x * 32);
        if (x < end - 1) {
            go_on(path, least_path, alone, step);
        } else {
            path = x < width - 1 ? alone + inherit(from_right, mine[x + 1], bits, step) : alone;
            least_path = least_of(path);
        }
        load(sum, sums.data + first_sum + x * 32);
        sum += path;
        store(total + 1, sum);
        const Costs least = least_of(sum);
        const int best = __builtin_ctz(bits_of(sum == least));
        const unsigned bit = 1u << best, upper = (bit & steps_up) << 1, lower = (bit & steps_up << 1) >> 1;
        const int below = total[best] - least[0], above = total[best + 2] - least[0];
        const int has_both = -(int)((steps_up & steps_up << 1) >> best & 1);
        lower_cost[x] = least[0] + (below & has_both);
        upper_cost[x] = least[0] + (above & has_both);
        // The best rival is not next to the best.
        const Costs rival = least_of(sum | (lanes_of(lower | bit | upper) & 32767));
        result[x] = best;
        cost.data[row * width + x] = least[0];
        second.data[row * width + x] = rival[0];
    }
    store(from_right, path - least_path);
}
for (int x = 0; x < width; ++x) {
    const int best = result[x], least = cost.data[row * width + x], rival = second.data[row * width + x];
    const int found = ((mine[x] >> (7 * (best >> 3))) & 127) * 8 + (best & 7);
    result[x] = rival * (100 - uniqueness) >= least * 100 ? found : -1;
}
// Of several pixels with the same partner, the best has it, or the first from the right.
for (int x = width - 1; x >= 0; --x) {
    const int column = x + searched - result[x], least = cost.data[row * width + x];
    if (result[x] >= 0 && least < right_cost[column]) {
        right_cost[column] = least;
        right_found[column] = result[x];
    }
}
// A parabola through the three costs; the quotient is exact, because both numbers are below 2^24.
for (int x = 0; x < width; ++x) {
    const int least = cost.data[row * width + x], lower = lower_cost[x], upper = upper_cost[x];
    const int bend = lower + upper - 2 * least > 1 ? lower + upper - 2 * least : 1;
    const int shift = (float)((lower - upper) * 16 + bend) / (float)(2 * bend);
    result[x] = result[x] < 0 ? NOT_FOUND : result[x] * 16 + shift;
}
// A pixel whose partner in the right eye found something else has no match; both roundings have to disagree.
for (int x = 0; x < width; ++x) {
    const int found = result[x], down = found >> 4, up = (found + 15) >> 4;
    const int partner = right_found[x + searched - down], other = right_found[x + searched - up];
    const bool agrees = (partner < 0) | (other < 0) | (__builtin_abs(partner - down) <= left_right)
        | (__builtin_abs(other - up) <= left_right);
    result[x] = agrees ? found : NOT_FOUND;
}
"""
_CONSTANTS = f"constexpr short MISSING = {MISSING}, NOT_FOUND = {NOT_FOUND};"


@wp.func_native(_CONSTANTS + _RELAX + _DOWN)
def sum_down(
    blocks: wp.array[int],  # per pixel, packed; see blocks.py
    costs: wp.array[wp.int16],
    steps: wp.array[wp.int16],  # see `neighbor_steps`
    paths: wp.array[wp.int16],
    sums: wp.array[wp.int16],
    first_cost: int,  # where in ``costs`` the row begins, and so on
    first_sum: int,
    first_before: int,  # paths of the row above: [3, width, 32]
    first_after: int,  # of this one
    row: int,
    width: int,
    is_first: bool,  # whether paths from above begin here
    small_step: int,  # P1
    large_step: int,  # P2
):
    """Write the sum of the paths from the left, the upper left, above and the upper right."""
    ...


@wp.func_native(_CONSTANTS + _RELAX + _CHOOSE)
def choose_best(
    blocks: wp.array[int],
    costs: wp.array[wp.int16],
    steps: wp.array[wp.int16],
    sums: wp.array[wp.int16],
    right: wp.array[wp.int16],  # scratch: [4, width + searched]
    disparity: wp.array[wp.int16],  # [height, width], in sixteenths of a pixel
    cost: wp.array[wp.int16],  # [height, width], of the five paths together
    second: wp.array[wp.int16],  # [height, width], of the best that is not next to it
    first_cost: int,
    first_sum: int,
    first_right: int,
    row: int,
    width: int,
    searched: int,
    small_step: int,
    large_step: int,
    uniqueness: int,  # by how much the best must be better than the second [%]
    left_right: int,  # largest difference between the eyes [px]
):
    """Add the path from the right; write the best disparity, where it passes the checks, and its costs."""
    ...


def neighbor_steps(small_step: int) -> np.ndarray:
    """Return what a step to the next lower and upper lane costs, (8, 2, 32), int16.

    The first index is bits 28 to 30 of a pixel's blocks: lanes of blocks that are not neighbors are none.
    """
    table = np.full((8, 2, 32), MISSING, np.int16)
    for bits in range(8):
        for lane in range(1, 32):
            within = lane % 8 != 0
            if within or (bits >> (lane // 8 - 1)) & 1:
                table[bits, 0, lane] = table[bits, 1, lane - 1] = small_step
    return table
