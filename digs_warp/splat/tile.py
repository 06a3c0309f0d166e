# type: ignore
# (device code, which Warp's stubs do not type)
"""What the forward and the backward pass over a tile share: its shape, its checks, and the exponential."""

import warp as wp

from digs_warp.splat.config import TILE_PIXELS, TILE_SIZE, vector_lanes

wp.set_module_options({"enable_backward": False})

TILE = wp.constant(TILE_SIZE)
PIXELS = wp.constant(TILE_PIXELS)
# Columns are walked in groups of one vector.
LANES = wp.constant(vector_lanes())
GROUP_MASK = wp.constant(TILE_SIZE // vector_lanes() - 1)
# y & 15 is y, and tells LLVM that it is no negative index, which Warp would have to wrap: without it a
# third of the time of a row goes into index checks.
ROW_MASK = wp.constant(TILE_SIZE - 1)
# Whether a tile is saturated is looked up once every so many splats: a sum over its 256 pixels.
CHECK_EVERY = wp.constant(8)
# Saturated rows are looked for when the transmittances of a tile sum to less than this: of its 256 pixels.
CROWDED = wp.constant(TILE_PIXELS / 4.0)

# Coefficients of the polynomial for exp(x / 8): the powers of 1/8 are part of them.
_EXP_1 = wp.constant(0.999999642 / 8.0)
_EXP_2 = wp.constant(0.499992251 / 8.0**2)
_EXP_3 = wp.constant(0.166607097 / 8.0**3)
_EXP_4 = wp.constant(0.0414446555 / 8.0**4)
_EXP_5 = wp.constant(0.0078991186 / 8.0**5)
_EXP_6 = wp.constant(0.000950381975 / 8.0**6)


@wp.func
def exp_in_range(x: float) -> float:
    """exp(x) for -5.55 <= x <= 0 (where alpha can reach 1/255), relative error below 2e-6.

    (p(x/8))^8 with a minimax polynomial of degree 6; below the range it stays under 1/255.
    """
    y = wp.max(x, -6.0)
    p = _EXP_4 + y * (_EXP_5 + y * _EXP_6)
    p = 1.0 + y * (_EXP_1 + y * (_EXP_2 + y * (_EXP_3 + y * p)))
    p = p * p
    p = p * p
    return p * p
