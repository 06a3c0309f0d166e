"""Semi-global matching of one row: five paths of smoothness, the best disparity, and its checks.

Along a path, the cost of a disparity is its own plus the least of: the same disparity one pixel before, a
neighboring one plus P1, any other plus P2 (Hirschmueller 2008). Here a pixel knows only the 32 disparities
of its blocks; those that the pixel before did not try cost P2. Costs on a path are kept minus their least.
"""

import numpy as np
import warp as wp

# Cost of a neighboring disparity that the pixel does not try: more than any path can have.
MISSING = 8000

# Disparity is found in sixteenths of a pixel; this means none.
FIXED_POINT = 16
NOT_FOUND = -FIXED_POINT

# Written with Clang's vector types, which compile for any processor: the 32 costs of a pixel are one vector.
_RELAX = r"""
typedef short Costs __attribute__((ext_vector_type(32), aligned(2)));
typedef short Block __attribute__((ext_vector_type(8), aligned(2)));
const short missing = MISSING;
// What the disparities of a pixel (blocks: mine) inherit from those of the pixel before (blocks: its).
auto inherited = [&](const short* before, int its, int mine) -> Costs {
    if (its == mine) {
        Costs same = *(const Costs*)before;
        Costs lower = __builtin_shufflevector(same, same, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14,
            15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30);
        Costs upper = __builtin_shufflevector(same, same, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15,
            16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 31);
        const short* step = steps.data + ((mine >> 28) & 7) * 64;
        lower += *(const Costs*)step;
        upper += *(const Costs*)(step + 32);
        Costs least = __builtin_elementwise_min(same, (Costs)(short)large_step);
        return __builtin_elementwise_min(least, __builtin_elementwise_min(lower, upper));
    }
    short result[32];
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
        Block step = __builtin_elementwise_min(lower, upper) + (Block)(short)small_step;
        Block least = __builtin_elementwise_min(same, (Block)(short)large_step);
        *(Block*)(result + slot * 8) = __builtin_elementwise_min(least, step);
    }
    return *(const Costs*)result;
};
auto store = [](short* target, Costs costs) { *(Costs*)target = costs - (Costs)__builtin_reduce_min(costs); };
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
for (int x = 0; x < width; ++x) {
    const Costs cost = *(const Costs*)(own + x * 32);
    Costs from_left = cost, a = cost, b = cost, c = cost;
    if (x > 0)
        from_left += inherited(left, mine[x - 1], mine[x]);
    if (!is_first) {
        if (x > 0)
            a += inherited(before + (x - 1) * 32, upper_row[x - 1], mine[x]);
        b += inherited(before + size + x * 32, upper_row[x], mine[x]);
        if (x < width - 1)
            c += inherited(before + 2 * size + (x + 1) * 32, upper_row[x + 1], mine[x]);
    }
    *(Costs*)(sums.data + first_sum + x * 32) = from_left + a + b + c;
    store(left, from_left);
    store(after + x * 32, a);
    store(after + size + x * 32, b);
    store(after + 2 * size + x * 32, c);
}
"""

_CHOOSE = r"""
typedef bool Lanes __attribute__((ext_vector_type(32)));
const int* mine = blocks.data + row * width;
const short* own = costs.data + first_cost;
// Of each column of the right eye: the least cost of a match, and its disparity.
short* right_cost = right.data + first_right;
short* right_found = right_cost + width + searched;
for (int i = 0; i < width + searched; ++i) {
    right_cost[i] = 32767;
    right_found[i] = -1;
}
short from_right[32] __attribute__((aligned(64)));
short total[32] __attribute__((aligned(64)));
for (int x = width - 1; x >= 0; --x) {
    Costs path = *(const Costs*)(own + x * 32);
    if (x < width - 1)
        path += inherited(from_right, mine[x + 1], mine[x]);
    store(from_right, path);
    const Costs sum = *(const Costs*)(sums.data + first_sum + x * 32) + path;
    *(Costs*)total = sum;
    const short least = __builtin_reduce_min(sum);
    const Lanes is_best = __builtin_convertvector(sum == (Costs)least, Lanes);
    unsigned lanes;
    __builtin_memcpy(&lanes, &is_best, 4);
    const int best = __builtin_ctz(lanes);
    const int slot = best >> 3;
    const int found = ((mine[x] >> (7 * slot)) & 127) * 8 + (best & 7);
    // Whether the disparities next to the best are in the next lanes.
    const int neighbors = (mine[x] >> 28) & 7;
    const bool has_lower = (best & 7) != 0 || (slot > 0 && ((neighbors >> (slot - 1)) & 1));
    const bool has_upper = (best & 7) != 7 || (slot < 3 && ((neighbors >> slot) & 1));
    // The best rival is not next to the best.
    const int lower = has_lower ? total[best - 1] : 0, upper = has_upper ? total[best + 1] : 0;
    total[best] = 32767;
    if (has_lower) total[best - 1] = 32767;
    if (has_upper) total[best + 1] = 32767;
    const int rival = __builtin_reduce_min(*(const Costs*)total);
    short result = NOT_FOUND;
    if (rival * (100 - uniqueness) >= least * 100) {
        const int column = x + searched - found;
        if (right_cost[column] > least) {
            right_cost[column] = least;
            right_found[column] = found;
        }
        result = found * 16;
        if (has_lower && has_upper) {  // a parabola through the three costs
            const int bend = lower + upper - 2 * least > 1 ? lower + upper - 2 * least : 1;
            result += ((lower - upper) * 16 + bend) / (2 * bend);
        }
    }
    disparity.data[row * width + x] = result;
    cost.data[row * width + x] = least;
    second.data[row * width + x] = rival;
}
// A pixel whose partner in the right eye found something else has no match; both roundings have to disagree.
for (int x = 0; x < width; ++x) {
    const int found = disparity.data[row * width + x];
    if (found < 0)
        continue;
    bool agrees = false;
    for (int up = 0; up < 2; ++up) {
        const int whole = (found + 15 * up) >> 4;
        const int partner = right_found[x + searched - whole];
        const int difference = partner - whole;
        agrees = agrees || partner < 0 || (difference <= left_right && difference >= -left_right);
    }
    if (!agrees)
        disparity.data[row * width + x] = NOT_FOUND;
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
    right: wp.array[wp.int16],  # scratch: [2, width + searched]
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
