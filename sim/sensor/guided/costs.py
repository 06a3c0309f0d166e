"""Matching costs of the disparities that the pixels try: sums over a window, a tile at a time.

The cost of one pixel pair is the smaller of the two distances between a pixel and the range around its
partner (Birchfield and Tomasi 1998), of the slopes plus a quarter of that of the gray values, at most 93.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

import warp as wp

# Rows and columns of a tile. Vectors have 64 columns; the rest are the margin of the largest window. With
# more rows fewer are made twice, but their costs no longer stay in the cache until they are summed.
TILE_ROWS = 8
TILE_COLUMNS = 58
LARGEST_WINDOW = 7

# Written with Clang's vector types, which compile for any processor. Warp has no saturating subtraction,
# no transposition and no vectors of 64 bytes; as loops over its arrays this takes several times as long.
_TILE_COSTS = r"""
typedef unsigned char Bytes __attribute__((ext_vector_type(64), aligned(1)));
typedef short Shorts __attribute__((ext_vector_type(64), aligned(2)));
typedef short Block __attribute__((ext_vector_type(8), aligned(2)));
typedef short Quads __attribute__((ext_vector_type(32), aligned(2)));
const int plane = height * pitch;
const int side = 2 * reach + 1;
const int last_x = x0 + TILE_COLUMNS < width ? x0 + TILE_COLUMNS : width;
const int last_lane = width - 1 - x0 + reach;  // of the image; it may lie beyond the vector

// In the rows of the tile: runs of pixels with the same blocks, one bit a pixel; the blocks that any tries.
struct Run { int blocks; unsigned long long pixels; };
Run runs[TILE_ROWS][TILE_COLUMNS];
int run_counts[TILE_ROWS] = {};
unsigned long long needed[2] = {0, 0};
for (int r = 0; r < TILE_ROWS && y0 + r < height; ++r) {
    const int* row = blocks.data + (y0 + r) * width + x0;
    for (int first = 0, end; first < last_x - x0; first = end) {
        for (end = first + 1; end < last_x - x0 && row[end] == row[first];)
            ++end;
        runs[r][run_counts[r]++] = {row[first], ((1ull << (end - first)) - 1) << first};
        for (int bits = row[first], slot = 0; slot < 4; ++slot, bits >>= 7)
            needed[(bits & 127) >> 6] |= 1ull << (bits & 63);
    }
}

auto minus = [](Bytes a, Bytes b) -> Bytes { return __builtin_elementwise_sub_sat(a, b); };
// A row of one kind of plane: values, lowest, highest.
struct Row { Bytes value, low, high; };
auto row_at = [&](const unsigned char* first) -> Row {
    return {*(const Bytes*)first, *(const Bytes*)(first + plane), *(const Bytes*)(first + 2 * plane)};
};
auto distance = [&](const Row& u, const Row& v) -> Bytes {
    Bytes of_left = __builtin_elementwise_max(minus(u.value, v.high), minus(v.low, u.value));
    Bytes of_right = __builtin_elementwise_max(minus(v.value, u.high), minus(u.low, v.value));
    return __builtin_elementwise_min(of_left, of_right);
};

// Halves of two vectors by turns, within each four quarters of them: a step of a transposition.
auto low_halves = [](Quads a, Quads b) -> Quads {
    return __builtin_shufflevector(a, b, 0, 32, 1, 33, 2, 34, 3, 35, 8, 40, 9, 41, 10, 42, 11, 43, 16, 48, 17,
        49, 18, 50, 19, 51, 24, 56, 25, 57, 26, 58, 27, 59);
};
auto high_halves = [](Quads a, Quads b) -> Quads {
    return __builtin_shufflevector(a, b, 4, 36, 5, 37, 6, 38, 7, 39, 12, 44, 13, 45, 14, 46, 15, 47, 20, 52,
        21, 53, 22, 54, 23, 55, 28, 60, 29, 61, 30, 62, 31, 63);
};

Bytes single[8][TILE_ROWS + LARGEST_WINDOW - 1];
short columns[TILE_ROWS][64 + LARGEST_WINDOW] __attribute__((aligned(64)));
short sums[8][TILE_ROWS][64] __attribute__((aligned(64)));
for (int block = 0; block < 128; ++block) {
    if (!((needed[block >> 6] >> (block & 63)) & 1))
        continue;
    for (int r = 0; r < TILE_ROWS + 2 * reach; ++r) {
        int y = y0 + r - reach;
        y = y < 0 ? 0 : y > height - 1 ? height - 1 : y;
        const int at = y * pitch + searched + x0 - reach;
        const Row slope = row_at(left_planes.data + at), gray = row_at(left_planes.data + at + 3 * plane);
        for (int m = 0; m < 8; ++m) {
            const unsigned char* right = right_planes.data + at - (block * 8 + m);
            const Bytes of_gray = distance(gray, row_at(right + 3 * plane)) >> (Bytes)2;
            single[m][r] = distance(slope, row_at(right)) + of_gray;
        }
    }
    for (int m = 0; m < 8; ++m) {
        Shorts column = 0;
        for (int r = 0; r < 2 * reach; ++r)
            column += __builtin_convertvector(single[m][r], Shorts);
        for (int r = 0; r < TILE_ROWS; ++r) {
            column += __builtin_convertvector(single[m][r + 2 * reach], Shorts);
            short* line = columns[r];
            *(Shorts*)line = column;
            // At the borders of the image the first and the last column are repeated.
            if (x0 == 0)
                for (int i = 0; i < reach; ++i)
                    line[i] = line[reach];
            for (int i = 1; last_lane < 64 && i <= reach; ++i)
                line[last_lane + i] = line[last_lane];
            column -= __builtin_convertvector(single[m][r], Shorts);
        }
        // A separate loop: a vector that was just written in pieces cannot be read at once.
        for (int r = 0; r < TILE_ROWS; ++r) {
            Shorts sum = 0;
            for (int i = 0; i < side; ++i)
                sum += *(const Shorts*)(columns[r] + i);
            *(Shorts*)sums[m][r] = sum;
        }
    }
    for (int r = 0; r < TILE_ROWS && y0 + r < height; ++r) {
        short* row_costs = costs.data + first_cost + (r * width + x0) * 32;
        unsigned long long with[4] = {}, any = 0;  // of each slot, which pixels try the block in it
        for (int run = 0; run < run_counts[r]; ++run)
            for (int slot = 0; slot < 4; ++slot)
                if (((runs[r][run].blocks >> (7 * slot)) & 127) == block)
                    any |= runs[r][run].pixels, with[slot] |= runs[r][run].pixels;
        for (int x = 0; x < last_x - x0; x += 32) {
            if ((unsigned)(any >> x) == 0)
                continue;
            // Eight disparities of 32 pixels, transposed: each pixel stores its own together.
            Quads a[8], b[8];
            for (int i = 0; i < 8; ++i)
                a[i] = *(const Quads*)&sums[i][r][x];
            for (int stage = 0; stage < 3; ++stage) {
                for (int i = 0; i < 4; ++i) {
                    b[2 * i] = low_halves(a[i], a[i + 4]);
                    b[2 * i + 1] = high_halves(a[i], a[i + 4]);
                }
                for (int i = 0; i < 8; ++i)
                    a[i] = b[i];
            }
            short of_pixels[8][32] __attribute__((aligned(64)));
            for (int i = 0; i < 8; ++i)
                *(Quads*)of_pixels[i] = a[i];
            for (int part = 0; part < 32; part += 8)
                for (int slot = 0; slot < 4; ++slot) {
                    unsigned here = (with[slot] >> (x + part)) & 255;
                    short* target = row_costs + (x + part) * 32 + slot * 8;
                    if (here == 255)  // the usual case
                        for (int i = 0; i < 8; ++i)
                            *(Block*)(target + i * 32) = *(const Block*)&of_pixels[i][part];
                    else
                        for (; here; here &= here - 1) {
                            const int i = __builtin_ctz(here);
                            *(Block*)(target + i * 32) = *(const Block*)&of_pixels[i][part];
                        }
                }
        }
    }
}
"""
_CONSTANTS = f"""
constexpr int TILE_ROWS = {TILE_ROWS}, TILE_COLUMNS = {TILE_COLUMNS};
constexpr int LARGEST_WINDOW = {LARGEST_WINDOW};
"""


@wp.func_native(_CONSTANTS + _TILE_COSTS)
def tile_costs(
    left_planes: wp.array[wp.uint8],  # see planes.py
    right_planes: wp.array[wp.uint8],
    blocks: wp.array[int],  # per pixel, packed; see blocks.py
    costs: wp.array[wp.int16],  # [TILE_ROWS, width, 32], in the order of the pixel's blocks
    first_cost: int,  # where in ``costs`` the row y0 begins
    x0: int,
    y0: int,
    width: int,
    height: int,
    pitch: int,
    searched: int,  # end of the search range, and columns in front of the planes
    reach: int,  # of the window to either side
):
    """Write the costs of the blocks of each pixel of the tile that begins at (x0, y0)."""
    ...
