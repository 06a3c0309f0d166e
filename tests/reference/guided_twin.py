"""Semi-global matching over a set of disparities per pixel, from the formulas: the twin of the guided search.

Slow and in whole numbers: Birchfield and Tomasi (1998) for the costs, Hirschmueller (2008) for the paths.
"""

import numpy as np
from scipy.ndimage import convolve, sobel

# From the pixel before: rows down, columns right.
PATHS = np.array([[0, 1], [1, 1], [1, 0], [1, -1], [0, -1]])
NEVER = 10**6


def twin_costs(left: np.ndarray, right: np.ndarray, disparities: int, window: int) -> np.ndarray:
    """Return the cost of every disparity, (height, width, disparities), with black columns to the left."""
    height, width = left.shape
    pad = ((0, 0), (disparities, 0))
    planes = [_planes(np.pad(image.astype(np.int64), pad)) for image in (left, right)]
    single = np.zeros((height, width, disparities), np.int64)
    at = np.arange(width) + disparities
    for (u, u_low, u_high), (v, v_low, v_high), divisor in zip(*planes, (1, 4), strict=True):
        for d in range(disparities):
            a, b = (slice(None), at), (slice(None), at - d)
            of_left = np.maximum(np.maximum(u[a] - v_high[b], v_low[b] - u[a]), 0)
            of_right = np.maximum(np.maximum(v[b] - u_high[a], u_low[a] - v[b]), 0)
            single[..., d] += np.minimum(of_left, of_right) // divisor
    return convolve(single, np.ones((window, window, 1), int), mode="nearest")


def _planes(gray: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Slope (Sobel, cut off at 15, shifted by 15) and gray value, each with its range half a pixel around."""
    slope = np.clip(sobel(gray, axis=1, mode="nearest"), -15, 15) + 15
    slope[:, [0, -1]] = 15
    planes = []
    for values in (slope, gray):
        before, after = values.copy(), values.copy()
        before[:, 1:] = (values[:, 1:] + values[:, :-1]) // 2
        after[:, :-1] = before[:, 1:]
        stack = np.stack([values, before, after])
        planes.append((values, stack.min(axis=0), stack.max(axis=0)))
    return planes


def twin_sums(costs: np.ndarray, tried: np.ndarray, small_step: int, large_step: int) -> np.ndarray:
    """Return the sum of the five paths; ``tried``: which disparities a pixel tries, bool, as ``costs``."""
    height, width, disparities = costs.shape
    total = np.zeros_like(costs)
    for down, across in PATHS:
        path = np.zeros_like(costs)
        columns = range(width) if across >= 0 else range(width - 1, -1, -1)
        for y in range(height):
            for x in columns:
                path[y, x] = costs[y, x]
                y0, x0 = y - down, x - across
                if 0 <= y0 and 0 <= x0 < width:
                    before = np.where(tried[y0, x0], path[y0, x0], NEVER)
                    around = np.pad(before, 1, constant_values=NEVER)
                    step = np.minimum(around[:-2], around[2:]) + small_step
                    least = before.min()
                    path[y, x] += np.minimum.reduce(
                        [before, step, np.full(disparities, least + large_step)]
                    )
                    path[y, x] -= least
        total += path
    return np.where(tried, total, NEVER)


def twin_matches(
    sums: np.ndarray, uniqueness: int, left_right: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return disparity in sixteenths (-16: none), the least cost, and that of the best rival."""
    height, width, disparities = sums.shape
    found = np.full((height, width), -16)
    least, rival = np.zeros((height, width), int), np.zeros((height, width), int)
    for y in range(height):
        right_cost: dict[int, int] = {}
        right_found: dict[int, int] = {}
        for x in range(width - 1, -1, -1):
            values = sums[y, x]
            d = int(values.argmin())
            least[y, x] = values[d]
            others = [int(values[e]) for e in range(disparities) if abs(e - d) > 1]
            rival[y, x] = min(others)
            if rival[y, x] * (100 - uniqueness) < least[y, x] * 100:
                continue
            if least[y, x] < right_cost.get(x - d, 32767):
                right_cost[x - d], right_found[x - d] = int(least[y, x]), d
            found[y, x] = 16 * d
            if 0 < d < disparities - 1 and max(values[d - 1], values[d + 1]) < NEVER:
                bend = max(int(values[d - 1] + values[d + 1] - 2 * values[d]), 1)
                shift = int(values[d - 1] - values[d + 1]) * 16 + bend
                found[y, x] += int(shift / (2 * bend))  # rounds to zero, as C does
        for x in range(width):
            if found[y, x] >= 0:
                wholes = (found[y, x] // 16, -(-found[y, x] // 16))
                partners = [(right_found.get(x - whole), whole) for whole in wholes]
                if all(p is not None and abs(p - whole) > left_right for p, whole in partners):
                    found[y, x] = -16
    return found, least, rival


def tried_disparities(blocks: np.ndarray, disparities: int) -> np.ndarray:
    """Return which disparities packed blocks stand for, (height, width, disparities), bool."""
    tried = np.zeros((*blocks.shape, disparities), bool)
    for y, x in np.ndindex(blocks.shape):
        for block in unpacked(int(blocks[y, x])):
            tried[y, x, 8 * block : 8 * block + 8] = True
    return tried


def unpacked(bits: int) -> list[int]:
    """Return the blocks of a pixel in their order."""
    return [(bits >> (7 * slot)) & 127 for slot in range(4)]


def twin_blocks(
    disparity: float,
    around: np.ndarray,
    far: int,
    count: int,
    second: float = np.nan,
    hidden: bool = False,
) -> set[int]:
    """Return the blocks that a pixel tries, from the rules in words.

    Its own block and the nearer neighbor always; then that of the second surface, the one beyond a step, the
    one that the coarse search prefers, the neighbor of the second surface's. What is left of four goes to
    the nearest that are free, its own side first. In a hidden pixel, both neighbors of the coarse search's
    block, the nearer one first, come before the nearer neighbor of its own and instead of the second's.

    ``around``: disparities within four pixels; ``far``: half block that the coarse search prefers, -1: none;
    ``count``: of all blocks; ``second``: disparity of the second surface; ``hidden``: from the right eye.
    """
    own, side = _block_and_side(disparity)
    own = min(own, count - 1)
    side = 1 if disparity - 8 * own >= 4 else -1
    far, upper = (far // 2, far % 2) if far >= 0 else (-1, 0)
    wanted = [own] if hidden else [own, own + side]
    beyond = [
        v for v, step in ((around.max(), 1), (around.min(), -1)) if step * (v - disparity) > 2
    ]
    has_second = 0 <= second < 8 * count
    behind, nearer = _block_and_side(second if has_second else 0)
    if has_second:
        wanted.append(behind)
    wanted += [int(v // 8) for v in beyond[:1]]
    wanted.append(far)
    if hidden and far >= 0:
        wanted += [far + 1, far - 1] if upper else [far - 1, far + 1]
    elif has_second and not hidden:
        wanted.append(behind + nearer)
    wanted += [own + distance * way for distance in range(1, 8) for way in (side, -side)]
    chosen: list[int] = []
    for block in wanted:
        if 0 <= block < count and block not in chosen:
            chosen.append(block)
    return set(chosen[:4])


def twin_hidden(surface: np.ndarray) -> np.ndarray:
    """Return what the right eye does not see, (height, width), bool, from disparity [px].

    In its image, that lies more than a pixel farther right than something that follows in the left one.
    """
    hidden = np.zeros(surface.shape, bool)
    for y, row in enumerate(surface):
        columns = [max(x - float(d), 0.0) for x, d in enumerate(row)]
        for x, column in enumerate(columns):
            hidden[y, x] = any(column > other + 1 for other in columns[x:])
    return hidden


def _block_and_side(disparity: float) -> tuple[int, int]:
    """Return the block of a disparity, and on which side the nearer neighbor is."""
    return int(disparity // 8), 1 if disparity % 8 >= 4 else -1
