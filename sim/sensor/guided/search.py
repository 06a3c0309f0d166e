"""The band-limited search of a pair: strips of the image, a launch for all."""

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.checks import DigsError, check_shape
from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.parallel import launch_parallel, packed
from digs_warp.device.warp_start import start_warp
from digs_warp.sim.sensor.guided.blocks import BLOCK, BLOCKS, MAX_BLOCKS, choose_blocks
from digs_warp.sim.sensor.guided.costs import LARGEST_WINDOW, TILE_COLUMNS, TILE_ROWS, tile_costs
from digs_warp.sim.sensor.guided.paths import (
    FIXED_POINT,
    NOT_FOUND,
    choose_best,
    neighbor_steps,
    sum_down,
)
from digs_warp.sim.sensor.guided.planes import EyePlanes, make_planes
from digs_warp.sim.sensor.matcher import (
    ISLAND,
    ISLAND_STEP,
    LARGE_STEP,
    LEFT_RIGHT,
    SMALL_STEP,
    match,
)

wp.set_module_options(vector_module_options())

# The full search runs on images this many times smaller; there, a block is one disparity.
COARSE = BLOCK


def coarse_half_blocks(left: np.ndarray, right: np.ndarray, count: int, window: int) -> np.ndarray:
    """Return what a full search of small images prefers, in half blocks, int32, -1 where it finds none.

    Without its checks: a wrong match in repeating or missing texture is what the pixel should try.

    Args:
        left: gray image, (height, width), uint8.
        right: of the same size.
        count: of the blocks in the search range.
        window: width of the matching window [px].

    Returns:
        One for every 8 x 8 pixels: twice the block, plus one in its upper half.
    """
    import cv2

    height, width = left.shape
    size = (max(1, width // COARSE), max(1, height // COARSE))
    small, small_right = (
        cv2.resize(image, size, interpolation=cv2.INTER_AREA) for image in (left, right)
    )
    disparities = -(-count // 16) * 16
    found = match(small, small_right, disparities, window, checks=False)
    found[~(found < count)] = -1
    return np.floor(2 * found).clip(-1).astype(np.int32)


# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false


start_warp()

# Strips are independent, so that threads can share an image; their height never depends on the threads.
STRIP_ROWS = 180

# Rows above a strip from which its paths start: after them, they hardly depend on where they began.
WARM_UP = 16

# By how much a match must be better than its best rival [%]. The full search asks for 10; three more stand
# for the rivals that are not tried: as many pixels are then missing.
UNIQUENESS = 13

PATHS = 5  # along which costs are smooth

_LANES = wp.constant(BLOCKS * BLOCK)
_TILE_ROWS = wp.constant(TILE_ROWS)
_TILE_COLUMNS = wp.constant(TILE_COLUMNS)
_STRIP_ROWS = wp.constant(STRIP_ROWS)
_WARM_UP = wp.constant(WARM_UP)
_LEFT_RIGHT = wp.constant(LEFT_RIGHT)


@wp.struct
class Pair:
    """A pair of images and what is searched."""

    left: wp.array[wp.uint8]  # planes
    right: wp.array[wp.uint8]
    blocks: wp.array[int]
    steps: wp.array[wp.int16]
    width: int
    height: int
    pitch: int
    searched: int
    reach: int
    small_step: int
    large_step: int
    uniqueness: int


@wp.struct
class Scratch:
    """Memory of the strips, one after the other."""

    costs: wp.array[wp.int16]  # [strips, TILE_ROWS, width, 32]
    sums: wp.array[wp.int16]  # [strips, width, 32]
    paths: wp.array[wp.int16]  # [strips, 2, 3, width, 32]
    right: wp.array[wp.int16]  # [strips, 4, width + searched]


@wp.kernel
def search_kernel(
    first: int,
    pair: Pair,
    scratch: Scratch,
    # outputs
    disparity: wp.array[wp.int16],
    cost: wp.array[wp.int16],
    second: wp.array[wp.int16],
):
    """Match a strip, row by row from above; costs are made for a row of tiles at a time."""
    strip = first + wp.tid()
    begin = strip * _STRIP_ROWS
    start = wp.max(begin - _WARM_UP, 0)
    row_size = pair.width * _LANES
    costs = strip * _TILE_ROWS * row_size
    sums = strip * row_size
    paths = strip * 6 * row_size
    for row in range(start, wp.min(begin + _STRIP_ROWS, pair.height)):
        if (row - start) % _TILE_ROWS == 0:
            for tile in range((pair.width + _TILE_COLUMNS - 1) / _TILE_COLUMNS):
                # fmt: off
                tile_costs(pair.left, pair.right, pair.blocks, scratch.costs, costs, tile * _TILE_COLUMNS,
                           row, pair.width, pair.height, pair.pitch, pair.searched, pair.reach)
                # fmt: on
        own = costs + (row - start) % _TILE_ROWS * row_size
        before = paths + (row - start) % 2 * 3 * row_size
        after = paths + (row - start + 1) % 2 * 3 * row_size
        # fmt: off
        sum_down(pair.blocks, scratch.costs, pair.steps, scratch.paths, scratch.sums, own, sums, before,
                 after, row, pair.width, row == start, pair.small_step, pair.large_step)
        if row >= begin:
            choose_best(pair.blocks, scratch.costs, pair.steps, scratch.sums, scratch.right, disparity,
                        cost, second, own, sums, strip * 4 * (pair.width + pair.searched), row,
                        pair.width, pair.searched, pair.small_step, pair.large_step, pair.uniqueness,
                        _LEFT_RIGHT)
        # fmt: on


@dataclass(frozen=True, eq=False)
class Found:
    """What the search found.

    Attributes:
        disparity: [px], (height, width), float32, NaN where a check failed.
        cost: of the best disparity, sum over the paths and the window, (height, width), int16.
        rival: the same of the best disparity that is not next to it.
    """

    disparity: np.ndarray
    cost: np.ndarray
    rival: np.ndarray


def search(
    left: np.ndarray,
    right: np.ndarray,
    surface: np.ndarray,
    disparities: int,
    window: int = 5,
    second: np.ndarray | None = None,
    uniqueness: int = UNIQUENESS,
    smoothness: float = 1.0,
) -> Found:
    """Match a rectified pair in a band round the true disparity.

    Args:
        left: gray image, (height, width), uint8.
        right: of the same size.
        surface: true disparity of the left image [px], (height, width), float32, NaN where there is nothing.
        disparities: end of the search range, which begins at 0 [px]; a multiple of 8, 32 to 1024.
        window: width of the square block [px], 1, 3, 5 or 7.
        second: disparity of what shows through a surface or is reflected in it [px], (height, width),
            float32, NaN where there is nothing of that kind; None: nowhere. Such pixels try it as well.
        uniqueness: by how much a match must be better than its best rival [%], 0 to 100.
        smoothness: factor on the penalties.
    """
    count = disparities // BLOCK
    if disparities % BLOCK or not BLOCKS <= count <= MAX_BLOCKS:
        raise DigsError(f"disparities: {disparities}, expected a multiple of 8 from 32 to 1024")
    if window % 2 == 0 or not 1 <= window <= LARGEST_WINDOW:
        raise DigsError(f"window: {window}, expected 1, 3, 5 or 7 pixels; wider ones overflow")
    check_shape("right image", right, left.shape)
    true = known_disparity(surface, disparities)
    eyes = make_planes(left, right, disparities)
    coarse = coarse_half_blocks(left, right, count, window)
    blocks = choose_blocks(true, coarse, count, second)
    raw, cost, rival = search_blocks(eyes, blocks, window, uniqueness, smoothness)
    return Found(_without_islands(raw), cost, rival)


def known_disparity(surface: np.ndarray, disparities: int) -> np.ndarray:
    """Return the true disparity within the search range, 0 where there is nothing."""
    import cv2

    true = np.clip(surface, 0, disparities, dtype=np.float32)
    return cv2.patchNaNs(true, 0.0)


def search_blocks(
    eyes: EyePlanes,
    blocks: wp.array,
    window: int,
    uniqueness: int = UNIQUENESS,
    smoothness: float = 1.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return disparity in sixteenths of a pixel and the two costs, (height, width), int16; see `search`."""
    width, height = eyes.width, eyes.height
    strips = -(-height // STRIP_ROWS)
    small_step, large_step = (
        round(smoothness * step * window * window) for step in (SMALL_STEP, LARGE_STEP)
    )
    steps = wp.array(neighbor_steps(small_step).reshape(-1), dtype=wp.int16, device="cpu")
    pair = packed(
        Pair,
        left=eyes.left,
        right=eyes.right,
        blocks=blocks.flatten(),
        steps=steps,
        width=width,
        height=height,
        pitch=eyes.pitch,
        searched=eyes.searched,
        reach=window // 2,
        small_step=small_step,
        large_step=large_step,
        uniqueness=uniqueness,
    )
    lanes = width * BLOCKS * BLOCK
    scratch = packed(
        Scratch,
        costs=_shorts(strips * TILE_ROWS * lanes),
        sums=_shorts(strips * lanes),
        paths=_shorts(strips * 6 * lanes),
        right=_shorts(strips * 4 * (width + eyes.searched)),
    )
    outputs = [_shorts(height * width) for _ in range(3)]
    launch_parallel(search_kernel, strips, [pair, scratch, *outputs])
    disparity, cost, rival = (output.numpy().reshape(height, width) for output in outputs)
    return disparity, cost, rival


def _shorts(count: int) -> wp.array:
    return wp.empty(count, dtype=wp.int16, device="cpu")


def _without_islands(sixteenths: np.ndarray) -> np.ndarray:
    """Return disparity [px] after OpenCV's median; NaN in small islands and where there is none."""
    import cv2

    smooth = cv2.medianBlur(sixteenths, 3)
    cv2.filterSpeckles(smooth, NOT_FOUND, ISLAND, ISLAND_STEP * FIXED_POINT)
    # What matched beyond the left border of the right image matched nothing.
    inside = np.arange(smooth.shape[1], dtype=np.float32) + np.float32(0.5)
    disparity = smooth * np.float32(1 / FIXED_POINT)
    return np.where((smooth >= 0) & (disparity <= inside), disparity, np.float32(np.nan))
