"""Small islands of disparity are dropped: OpenCV's ``filterSpeckles``, several times as fast.

Pixels belong together if they are neighbors along rows or columns and differ by no more than a limit. Each
row is cut into runs, and runs of neighboring rows are joined; 32 pixels are compared at a time.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.parallel import launch_here

wp.set_module_options(vector_module_options())

# Pixels that are compared at a time, and columns without values in front of a row.
_WORD = 32

# Written with Clang's vector types, which compile for any processor.
_FIND = r"""
typedef short Word __attribute__((ext_vector_type(32), aligned(2)));
typedef bool Bits __attribute__((ext_vector_type(32)));
const int words = (width + 31) / 32, pitch = 32 * (words + 1);
int* parent = runs.data;  // of each run: another run of its island, or itself
int* size = parent + width * height;  // of the island, at its first run
int* start = size + width * height;  // where the run begins
int* length = start + width * height;
// Of two rows in turn: pixels after 32 missing ones; first pixels of runs; how many runs there were before.
short* pixels = rows.data;
unsigned* firsts = (unsigned*)masks.data;
int* before = masks.data + 2 * words;
for (int i = 0; i < 2 * pitch; ++i)
    pixels[i] = missing;
for (int i = 0; i < words; ++i)
    firsts[i] = 0;

auto bits_of = [](Word is_true) -> unsigned {
    const Bits bits = __builtin_convertvector(is_true, Bits);
    unsigned result;
    __builtin_memcpy(&result, &bits, 4);
    return result;
};
auto island_of = [&](int run) {
    while (parent[run] != run)
        run = parent[run] = parent[parent[run]];
    return run;
};
auto together = [&](Word a, Word b) -> unsigned {
    const Word apart = a > b ? a - b : b - a;
    return bits_of((apart <= (short)step) & (a != missing) & (b != missing));
};
// The run of a pixel: all that begin up to it, in its word and before.
auto run_at = [](unsigned first, int earlier, unsigned bit) {
    return earlier + __builtin_popcount(first & (bit | (bit - 1))) - 1;
};
int count = 0;
for (int y = 0; y < height; ++y) {
    short* here = pixels + (y & 1) * pitch + 32;
    const short* above = pixels + (~y & 1) * pitch + 32;
    unsigned* first = firsts + (y & 1) * words;
    const unsigned* first_above = firsts + (~y & 1) * words;
    int* earlier = before + (y & 1) * words;
    const int* earlier_above = before + (~y & 1) * words;
    for (int x = 0; x < width; ++x)
        here[x] = disparity.data[y * width + x];
    unsigned linked_before = 0;
    for (int word = 0; word < words; ++word) {
        const Word v = *(const Word*)(here + 32 * word);
        const unsigned known = bits_of(v != missing);
        const unsigned joined = together(v, *(const Word*)(here + 32 * word - 1));
        const unsigned begins = known & ~joined;
        first[word] = begins;
        earlier[word] = count;
        // Up to the first beginning, pixels continue the run of the word before.
        unsigned rest = begins, part = begins ? (begins & -begins) - 1 : ~0u;
        if (known & part) {
            length[count - 1] += __builtin_popcount(known & part);
            size[count - 1] = length[count - 1];
        }
        while (rest) {
            const unsigned bit = rest & -rest;
            rest ^= bit;
            part = (rest ? (rest & -rest) - 1 : ~0u) & ~(bit - 1);
            parent[count] = count;
            start[count] = y * width + 32 * word + __builtin_ctz(bit);
            size[count] = length[count] = __builtin_popcount(known & part);
            ++count;
        }
    }
    for (int word = 0; y > 0 && word < words; ++word) {
        const unsigned linked = together(*(const Word*)(here + 32 * word), *(const Word*)(above + 32 * word));
        // Runs that touch are joined where they begin to.
        unsigned touches = linked & (first[word] | first_above[word] | ~(linked << 1 | linked_before));
        linked_before = linked >> 31;
        for (; touches; touches &= touches - 1) {
            const unsigned bit = touches & -touches;
            const int a = island_of(run_at(first[word], earlier[word], bit));
            const int b = island_of(run_at(first_above[word], earlier_above[word], bit));
            if (a != b) {
                size[b] += size[a];
                parent[a] = b;
            }
        }
    }
}
for (int run = 0; run < count; ++run)
    if (size[island_of(run)] <= largest)
        for (int i = 0; i < length[run]; ++i)
            disparity.data[start[run] + i] = missing;
"""


@wp.func_native(_FIND)
def drop(
    disparity: wp.array[wp.int16],
    rows: wp.array[wp.int16],
    masks: wp.array[int],
    runs: wp.array[int],
    width: int,
    height: int,
    missing: wp.int16,
    largest: int,
    step: int,
):
    """Overwrite small islands with ``missing``."""
    ...


@wp.kernel
def islands_kernel(
    rows: wp.array[wp.int16],
    masks: wp.array[int],
    runs: wp.array[int],
    width: int,
    height: int,
    missing: wp.int16,
    largest: int,
    step: int,
    # in and out
    disparity: wp.array[wp.int16],
):
    """Process the image; a single thread."""
    drop(disparity, rows, masks, runs, width, height, missing, largest, step)


def drop_islands(disparity: np.ndarray, missing: int, largest: int, step: int) -> None:
    """Overwrite islands with ``missing``, in place.

    Args:
        disparity: in fixed point, (height, width), int16, C-contiguous, >= 0 or ``missing``.
        missing: what stands for no value, < 0.
        largest: number of pixels of an island that is still dropped.
        step: largest difference between neighbors of the same island.
    """
    height, width = disparity.shape
    words = -(-width // _WORD)
    rows = wp.empty(2 * _WORD * (words + 1), dtype=wp.int16, device="cpu")
    masks = wp.empty(4 * words, dtype=int, device="cpu")
    runs = wp.empty(4 * width * height, dtype=int, device="cpu")
    image = wp.array(disparity.reshape(-1), dtype=wp.int16, device="cpu", copy=False)
    inputs = [rows, masks, runs, width, height, missing, largest, step, image]
    launch_here(islands_kernel, 1, inputs)
