"""Semi-global matching over a set of disparities per pixel, from the formulas: the twin of the guided search.

Slow and in whole numbers: Birchfield and Tomasi (1998) for the costs, Hirschmueller (2008) for the paths.
"""

import numpy as np

PATHS = (
    (0, 1),
    (1, 1),
    (1, 0),
    (1, -1),
    (0, -1),
)  # from the pixel before: rows down, columns right
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
    reach = window // 2
    padded = np.pad(single, ((reach, reach), (reach, reach), (0, 0)), mode="edge")
    shifts = [(j, i) for j in range(window) for i in range(window)]
    return sum(padded[j : j + height, i : i + width] for j, i in shifts)  # pyright: ignore


def _planes(gray: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Slope (Sobel, cut off at 15, shifted by 15) and gray value, each with its range half a pixel around."""
    rows = np.pad(gray, ((1, 1), (0, 0)), mode="edge")
    weighted = rows[:-2] + 2 * rows[1:-1] + rows[2:]
    slope = np.full_like(gray, 15)
    slope[:, 1:-1] = np.clip(weighted[:, 2:] - weighted[:, :-2], -15, 15) + 15
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
    for slot in range(4):
        block = (blocks >> (7 * slot)) & 127
        for m in range(8):
            np.put_along_axis(tried, (8 * block + m)[..., None], True, axis=2)
    return tried


def twin_blocks(own: int, side: int, other: int, far: int, count: int) -> set[int]:
    """Return the four blocks that a pixel tries, from the rules in words.

    Its own and the nearer neighbor always. A far one and one beyond a step take the place of the remaining
    two; what is outside or there already is replaced by the nearest that is free, its own side first.
    """
    wanted = [own, own + side, own - side, own + 2 * side]
    beyond = other if other >= 0 and abs(other - own) > 1 else None
    remote = far if far >= 0 and abs(far - own) > 1 else None
    if beyond is not None and remote is not None:
        wanted[2:] = [beyond, remote]
    elif beyond is not None or remote is not None:
        wanted[3] = beyond if beyond is not None else remote  # pyright: ignore
    chosen = {block for block in wanted if 0 <= block < count}
    nearest = [own + distance * way for distance in range(1, 8) for way in (side, -side)]
    for block in nearest:
        if len(chosen) == 4:
            break
        if 0 <= block < count:
            chosen.add(block)
    return chosen
