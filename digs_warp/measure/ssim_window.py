"""The window and the constants of structural similarity (Wang et al. 2004), in numbers and for kernels."""

import math

import warp as wp

WINDOW = 11
REACH = WINDOW // 2  # the window reaches this far [px]
SIGMA = 1.5
C1 = 0.01**2  # for values in 0..1
C2 = 0.03**2


def window_weights() -> list[float]:
    """Return the 11 weights of the separable window; they sum to 1."""
    raw = [math.exp(-((i - REACH) ** 2) / (2 * SIGMA**2)) for i in range(WINDOW)]
    return [value / sum(raw) for value in raw]


# The window is symmetric: the weights of two taps at distance 5, 4, 3, 2, 1, and that of the middle one.
_PAIRS, _MIDDLE = window_weights()[:REACH], window_weights()[REACH]

# Products and sums are fused here alone. Pointers that share no memory, and loops of a length that is known
# where the function is inlined, become vector code without a check whether they overlap.
_FUSED = "#pragma clang fp contract(fast)"
_ALONG_SUM = [
    f"{w:.9g}f * (from[x + {i}] + from[x + {2 * REACH - i}])" for i, w in enumerate(_PAIRS)
]
_ALONG = f"""
{_FUSED}
const float* __restrict from = source.data + first;
float* __restrict to = result.data + start;
for (int x = 0; x < count; ++x)
    to[x] = {" + ".join([*_ALONG_SUM, f"{_MIDDLE:.9g}f * from[x + {REACH}]"])};
"""
# The rows of a ring, from 5 above to 5 below, where `digs_warp.measure.ssim.ring_place` puts them.
_RING = f"const float* __restrict ring = source.data + first;\nconst unsigned place = row + {4 * WINDOW};\n"
_RING_ROWS = "".join(
    f"const float* row{i} = ring + (place + {i - REACH}u) % {WINDOW}u * count;\n"
    for i in range(WINDOW)
)
_ACROSS_SUM = [f"{w:.9g}f * (row{i}[c] + row{2 * REACH - i}[c])" for i, w in enumerate(_PAIRS)]
_ACROSS = f"""
{_FUSED}
{_RING}{_RING_ROWS}
float* __restrict to = result.data + start;
for (int c = 0; c < count; ++c)
    to[c] = {" + ".join([*_ACROSS_SUM, f"{_MIDDLE:.9g}f * row{REACH}[c]"])};
"""


@wp.func_native(_ALONG)
def blur_along(
    source: wp.array[float], first: int, result: wp.array[float], start: int, count: int
):
    """Blur ``count`` values of a row; ``source`` has 10 more, from ``first`` on."""
    ...


@wp.func_native(_ACROSS)
def blur_across(
    source: wp.array[float],
    first: int,
    row: int,
    result: wp.array[float],
    start: int,
    count: int,
):
    """Blur ``row`` across the rows of a ring: 11 of them, each of ``count`` values, from ``first`` on."""
    ...
