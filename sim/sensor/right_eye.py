"""What the right eye cannot see: decided from disparity where that is safe, by rays elsewhere.

Only one direction is safe: a closed surface that both eyes see covers what lands behind it. The opposite is
not: sides of objects that the left eye does not see hide points, too.

One pass per row finds where the points of the left image land in the right one, and what covers them there.
NumPy needs a dozen passes over the image; see tests/reference/right_eye_twin.py.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

from collections.abc import Callable

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.parallel import launch_parallel
from digs_warp.device.warp_start import start_warp
from digs_warp.sim.sensor.arrays import shared

start_warp()
wp.set_module_options(vector_module_options())

# The classes of `classify`.
SEEN = 0
UNSURE = 1
HIDDEN = 2

# An edge may lie anywhere between two pixel centers. Half a pixel finds 99.5 % of the hidden pixels, and
# sends 4 to 10 % of all pixels of the sample meshes to the rays.
BETWEEN_PIXELS = 0.5

# A surface hides a point for certain if it is nearer by this much and steps less from pixel to pixel [px].
NEARER = 1.0


def _ahead(steps: int) -> str:
    """Return the code for the lanes of ``after`` moved down by some steps."""
    lanes = ", ".join(str(min(lane + steps, 16)) for lane in range(16))
    return f"__builtin_shufflevector(after, far, {lanes})"


# Written with Clang's vector types, which compile for any processor: sixteen pixels are one vector.
_ROW = r"""
typedef float Floats __attribute__((ext_vector_type(16), aligned(4)));
typedef int Ints __attribute__((ext_vector_type(16)));
typedef unsigned char Bytes __attribute__((ext_vector_type(16), aligned(1)));
const float FAR = 1e30f;
const float* own = disparity.data + row * width;
const float* solid = opaque.data + row * width;
const unsigned char* wanted = where.data + row * width;
unsigned char* found = state.data + row * width;
float* nearest = scratch.data + first_scratch;

// From right to left: a point that lands right of one further right in the left image may be hidden by it.
float leftmost = FAR, least = FAR;  // where points have landed so far; disparity of points that may be hidden
int x = width;
while (x % 16) {
    --x;
    const float landing = x - own[x];
    const bool may_be = leftmost < landing + BETWEEN && landing >= -0.5f && wanted[x];
    found[x] = may_be ? UNSURE : SEEN;
    least = may_be && own[x] < least ? own[x] : least;
    leftmost = landing < leftmost ? landing : leftmost;
}
const Floats far = FAR;
const Ints number = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
auto min = [](Floats a, Floats b) -> Floats { return __builtin_elementwise_min(a, b); };
Floats least_of_lanes = far;
while (x > 0) {
    x -= 16;
    const Floats here = *(const Floats*)(own + x);
    const Floats landing = __builtin_convertvector(number + x, Floats) - here;
    // Missing values land nowhere. Then: the least of each lane and all after it.
    Floats after = landing == landing ? landing : far;
    SUFFIX_MINIMUM
    const Floats before = min(leftmost, AFTER_NEXT);
    const Ints asked = __builtin_convertvector(*(const Bytes*)(wanted + x), Ints) != 0;
    const Ints may_be = (before < landing + BETWEEN) & (landing >= -0.5f) & asked;
    *(Bytes*)(found + x) = __builtin_convertvector(may_be & UNSURE, Bytes);
    least_of_lanes = min(least_of_lanes, may_be ? here : far);
    leftmost = after[0] < leftmost ? after[0] : leftmost;
}
const float least_vector = __builtin_reduce_min(least_of_lanes);
least = least_vector < least ? least_vector : least;
if (least >= FAR || width < 3)
    return;

// The row of the right image: the nearest opaque point that lands at each place. Of points that land
// together, the rightmost one is the nearest, and is written last. What can hide none is left out.
for (int i = 0; i < width; ++i)
    nearest[i] = __builtin_nanf("");
const float limit = least + NEARER;
for (int begin = 0; begin < width; begin += 16) {
    const int end = begin + 16 < width ? begin + 16 : width;
    if (end == begin + 16) {
        const Ints matters = *(const Floats*)(solid + begin) > limit;
        if (!__builtin_reduce_or(matters))
            continue;
    }
    for (int i = begin; i < end; ++i) {
        const float place = i - solid[i];
        if (place >= 0 && place < width)
            nearest[(int)place] = solid[i];
    }
}
auto distance = [](float a, float b) { return __builtin_fabsf(a - b); };
for (int begin = 0; begin < width; begin += 16) {
    const int end = begin + 16 < width ? begin + 16 : width;
    if (end == begin + 16) {
        const Bytes some = *(const Bytes*)(found + begin);
        if (!__builtin_reduce_or(some))
            continue;
    }
    for (int i = begin; i < end; ++i) {
        if (!found[i])
            continue;
        int middle = (int)(i - own[i]);
        middle = middle < 1 ? 1 : middle > width - 2 ? width - 2 : middle;
        const float left = nearest[middle - 1], here = nearest[middle], right = nearest[middle + 1];
        // Nearer on both sides, without a step between: no gap to look through.
        const bool closed = distance(left, here) < NEARER && distance(right, here) < NEARER;
        const float level = own[i] + NEARER;
        if (closed && left > level && here > level && right > level)
            found[i] = HIDDEN;
    }
}
"""
_ROW = _ROW.replace("AFTER_NEXT", _ahead(1)).replace(
    "SUFFIX_MINIMUM", "".join(f"after = min(after, {_ahead(steps)});" for steps in (1, 2, 4, 8))
)
_CONSTANTS = f"""
constexpr float BETWEEN = {BETWEEN_PIXELS}f, NEARER = {NEARER}f;
constexpr int SEEN = {SEEN}, UNSURE = {UNSURE}, HIDDEN = {HIDDEN};
"""


@wp.func_native(_CONSTANTS + _ROW)
def classify_row(
    disparity: wp.array[float],
    opaque: wp.array[float],
    where: wp.array[wp.uint8],
    scratch: wp.array[float],
    state: wp.array[wp.uint8],
    first_scratch: int,
    row: int,
    width: int,
):
    """Write the classes of a row."""
    ...


@wp.kernel
def _classify_kernel(
    first: int,
    width: int,
    disparity: wp.array[float],
    opaque: wp.array[float],
    where: wp.array[wp.uint8],
    # outputs
    scratch: wp.array[float],  # the right image
    state: wp.array[wp.uint8],
):
    """Process one row. The rows of a launch share the scratch memory of the first one."""
    row = first + wp.tid()
    classify_row(disparity, opaque, where, scratch, state, first * width, row, width)


def classify(disparity: np.ndarray, opaque: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Return SEEN, UNSURE or HIDDEN for each pixel: whether the right eye sees it, (height, width), uint8.

    Whatever hides a point from the right eye appears in the left image to the right of the point, and lands
    in the right image at the same place or to the left of it: an object in the triangle between both eyes
    and the point is seen by the left eye to the right of the point. If there is no such object, the point
    is seen. It is hidden for certain if a closed, nearer surface covers it. Points that land outside the
    right image count as seen: that is the invalid band, not occlusion.

    Args:
        disparity: [px], (height, width), float32, NaN where there is nothing.
        opaque: the same, without transparent surfaces.
        where: the pixels in question, (height, width), bool; the others are SEEN.
    """
    height, width = disparity.shape
    images = [shared(np.asarray(image, np.float32)) for image in (disparity, opaque)]
    images.append(shared(np.ascontiguousarray(where).view(np.uint8)))
    scratch = wp.empty(height * width, dtype=float, device="cpu")
    state = np.empty((height, width), np.uint8)
    launch_parallel(_classify_kernel, height, [width, *images, scratch, shared(state)])
    return state


def hidden_from_right(
    disparity: np.ndarray,
    opaque: np.ndarray,
    where: np.ndarray,
    right_visibility: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """Return which pixels of ``where`` an opaque surface hides from the right eye, (height, width), bool.

    Points that land outside the right image do not count: that is the invalid band, not occlusion.

    Args:
        disparity: [px], (height, width), NaN where there is nothing.
        opaque: the same, without transparent surfaces.
        where: the pixels in question, (height, width), bool.
        right_visibility: casts rays to find whether the right eye sees the pixels of a mask, both
            (height, width), bool; see `digs_warp.sim.sensor.frame.FrameRays`.
    """
    state = classify(disparity, opaque, where)
    hidden, unsure = state == HIDDEN, state == UNSURE
    if unsure.any():
        hidden |= unsure & ~right_visibility(unsure)
    return hidden
