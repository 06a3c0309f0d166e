"""What an object stands on and what is behind it: planes in a depth map, and what is far beyond them."""

import numpy as np

# A gap between near and far: the least jump of depth, and the shares of the known pixels that lie in it at
# most, and on both sides of it at least.
GAP_RATIO, GAP_SHARE, SIDE_SHARE = 1.25, 0.04, 0.1
# What is near has to take this share of the middle of the image.
MIDDLE_SHARE = 0.3

# A plane counts from this share of the known pixels on. Pixels belong to it within this relative distance.
# There may be a table, and walls.
PLANE_SHARE, PLANES = 0.25, 3
PLANE_MARGIN = 0.015
PLANE_TRIALS = 200
PLANE_SAMPLES = 2000

# A table or a wall reaches the border of the image, this share of what is known of it, or lies behind
# something while it spans nearly all that is known. A flat side of the object does neither.
PLANE_BORDER_SHARE = 0.3
LEAST_IN_FRONT = 0.003
PLANE_SPAN = 0.8

# Weight of a pixel by its distance to the middle, as a share of the image's shorter side.
CENTER_SIGMA = 0.2


def before_planes(depth: np.ndarray) -> np.ndarray:
    """Return the pixels that stand before the table and before the walls, (height, width) bool.

    What is far beyond an edge of the table goes first, for it may be most of the image. What is left after
    one plane is searched for another.
    """
    left = np.isfinite(depth)
    near = left & (depth < far_edge(depth))
    weights = middle_weights(depth.shape)
    # Else something reaches into the image before the object.
    cut = bool((near != left).any() and weights[near].sum() > MIDDLE_SHARE * weights[left].sum())
    left = near if cut else left
    for number in range(PLANES):
        accounted = on_or_behind_main_plane(np.where(left, depth, np.nan), number > 0 or cut)
        if not accounted.any():
            break
        left &= ~accounted
    return left


def far_edge(depth: np.ndarray) -> float:
    """Return the depth [m] in the widest gap of the depths, as between a table and what is far; inf: none.

    A gap is a jump of depth of at least `GAP_RATIO` that `GAP_SHARE` of the known pixels lie in at most, with
    at least `SIDE_SHARE` before it and behind it.
    """
    known = np.sort(np.log(depth[np.isfinite(depth)].astype(np.float64)))
    if not len(known):
        return np.inf
    inside = int(GAP_SHARE * len(known)) + 1
    first, last = int(SIDE_SHARE * len(known)), int((1 - SIDE_SHARE) * len(known)) - inside
    if last <= first:
        return np.inf
    widths = known[first + inside : last + inside] - known[first:last]
    widest = int(np.argmax(widths))
    if widths[widest] < np.log(GAP_RATIO):
        return np.inf
    return float(np.exp(known[first + widest] + widths[widest] / 2))


def on_or_behind_main_plane(depth: np.ndarray, only_border: bool = False) -> np.ndarray:
    """Return which pixels the main plane accounts for, (height, width) bool; none where there is no plane.

    With ``only_border`` a plane has to reach the border of the image, and what is in the middle has to be
    before it rather than behind it.

    The inverse depth of a plane is linear in the image, whatever the camera: 1 / z = a u + b v + c.
    It is found by RANSAC (Fischler and Bolles 1981) with a fixed seed.
    """
    v, u = np.nonzero(np.isfinite(depth))
    nothing = np.zeros(depth.shape, bool)
    if len(u) < 3:
        return nothing
    rows = np.stack([u, v, np.ones_like(u)], axis=1).astype(np.float64)
    inverse = 1.0 / depth[v, u].astype(np.float64)
    rng = np.random.default_rng(0)
    plane = _best_plane(rows, inverse, rng)
    if plane is None:
        return nothing
    on_plane = np.abs(rows @ plane - inverse) < PLANE_MARGIN * inverse
    plane = np.linalg.lstsq(rows[on_plane], inverse[on_plane], rcond=None)[0]
    gap = inverse - rows @ plane  # above 0: nearer than the plane
    on_plane, in_front = np.abs(gap) < PLANE_MARGIN * inverse, gap >= PLANE_MARGIN * inverse
    on_image = nothing.copy()
    on_image[v[on_plane], u[on_plane]] = True
    border = border_pixels(on_image)[border_pixels(np.isfinite(depth))]
    reaches_border = len(border) > 0 and border.mean() > PLANE_BORDER_SHARE
    span = np.ptp(rows[on_plane, :2], axis=0) / np.ptp(rows[:, :2], axis=0)
    leaves_some = in_front.mean() > LEAST_IN_FRONT
    lies_behind = leaves_some and span.min() > PLANE_SPAN
    if only_border:
        middle = middle_weights(depth.shape)[v, u]
        is_before = middle[in_front].sum() > middle[~in_front & ~on_plane].sum()
        is_surround = reaches_border and leaves_some and is_before
    else:
        is_surround = reaches_border or lies_behind
    if on_plane.mean() < PLANE_SHARE or not is_surround:
        return nothing
    accounted = nothing.copy()
    accounted[v, u] = ~in_front
    return accounted


def _best_plane(
    rows: np.ndarray, inverse: np.ndarray, rng: np.random.Generator
) -> np.ndarray | None:
    """Return (a, b, c) through three pixels that most of a sample agrees with."""
    sample = rng.choice(len(rows), min(PLANE_SAMPLES, len(rows)), replace=False)
    triples = rng.choice(sample, (PLANE_TRIALS, 3))
    corners = rows[triples]
    usable = np.abs(np.linalg.det(corners)) > 1.0  # three pixels that span a triangle
    if not usable.any():
        return None
    planes = np.linalg.solve(corners[usable], inverse[triples[usable]][..., None])[..., 0]
    gaps = np.abs(rows[sample] @ planes.T - inverse[sample, None])
    return planes[np.argmax((gaps < PLANE_MARGIN * inverse[sample, None]).sum(axis=0))]


def middle_weights(shape: tuple[int, ...]) -> np.ndarray:
    """Return 1 in the middle of the image, falling off toward its border, (height, width)."""
    height, width = shape
    sigma = CENTER_SIGMA * min(shape)
    v, u = np.mgrid[:height, :width]
    squared = (u - (width - 1) / 2) ** 2 + (v - (height - 1) / 2) ** 2
    return np.exp(-0.5 * squared / sigma**2)


def border_pixels(image: np.ndarray) -> np.ndarray:
    """Return the outermost pixels, (n,); the corners twice."""
    return np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
