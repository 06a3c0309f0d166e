"""Kernels of `bundle_adjustment`: the equations of one frame's points, one thread per frame.

How a point looks to another frame depends on how both cameras move and on the distance of the point. The
distance is eliminated here: a point adds to the equations the products of its slopes J along the motions,
less g g' / h, where g = sum w s J, h = 1 / sigma^2 + sum w s^2 and s is the slope along the distance
(the Schur complement). Sums are made in the order of the points, so they do not depend on the
number of threads.
"""

import warp as wp

from digs_warp.poses.lookup import Look, Target, look, row_of

wp.set_module_options({"enable_backward": False})

Motion = wp.types.vector(length=6, dtype=wp.float64)
Block = wp.types.matrix(shape=(6, 6), dtype=wp.float64)

_NOTHING = wp.constant(wp.float64(0.0))
_ONE = wp.constant(wp.float64(1.0))


@wp.struct
class Bundle:
    """What all frames see, and how much counts.

    ``image``, ``depth`` and the points are those of all frames, one behind the other. A residual of ``color``
    counts half; see `look` for ``hidden``. The logarithms of the nearness of the points are expected around
    ``usual``, and count by ``held`` = 1 / sigma^2.
    """

    begins: wp.array[int]  # [frames + 1] first pair of each frame
    targets: wp.array[int]  # [pairs] who sees its points
    target_from_source: wp.array[wp.mat44]  # [pairs]
    starts: wp.array[int]  # [frames + 1] first point of each frame
    points: wp.array[wp.vec3]  # in the axes of their frame, as measured [m]
    values: wp.array[float]  # of the points
    frames: wp.array[Target]
    image: wp.array[float]
    depth: wp.array[float]  # NaN: unknown
    nearer: wp.array[float]  # logarithm of measured over true distance of each point
    color: float
    hidden: float
    held: float
    usual: float


@wp.func
def look_at_point(bundle: Bundle, pair: int, index: int) -> Look:
    """Return what the pair's target shows of a point at its distance as it stands."""
    point = bundle.points[index] * wp.exp(-bundle.nearer[index])
    middle = wp.transform_point(bundle.target_from_source[pair], point)
    target = bundle.frames[bundle.targets[pair]]
    value = bundle.values[index]
    return look(middle, value, target, bundle.image, bundle.depth, bundle.hidden)


@wp.func
def weight_of(bundle: Bundle, found: Look) -> wp.float64:
    """Return what a residual counts."""
    ratio = found.color / bundle.color
    return wp.float64(1.0 / (bundle.color * bundle.color * (1.0 + ratio * ratio)))


@wp.func
def slope_of(found: Look) -> Motion:
    """Return the slope of a residual per motion of the point's frame, in the target's axes."""
    row = row_of(found.q, found.slope)
    slope = Motion()
    for i in range(6):
        slope[i] = wp.float64(row[i])
    return slope


@wp.func
def slope_nearer(bundle: Bundle, found: Look, pair: int, index: int) -> wp.float64:
    """Return the slope of a residual per logarithm of the nearness."""
    point = bundle.points[index] * wp.exp(-bundle.nearer[index])
    moved = wp.transform_vector(bundle.target_from_source[pair], point)
    return -wp.float64(wp.dot(found.slope, moved))


@wp.func
def expected_pull(bundle: Bundle, index: int) -> wp.float64:
    """Return how much a point is drawn to its expected nearness."""
    return wp.float64(bundle.held * (bundle.usual - bundle.nearer[index]))


@wp.func
def product(a: Motion, b: Motion, factor: wp.float64) -> Block:
    """Return factor a b'."""
    found = Block()
    for i in range(6):
        for j in range(6):
            found[i, j] = factor * a[i] * b[j]
    return found


@wp.kernel
def sum_kernel(
    first: int,
    bundle: Bundle,
    blocks: wp.array[int],  # [frames] first block of each frame
    # scratch: g of a point, for each pair; zeros where the target does not see it
    slopes: wp.array[Motion],
    # outputs
    matrices: wp.array[Block],  # of each frame: for pairs a and b <= a at a (a + 1) / 2 + b
    sides: wp.array[Motion],  # [pairs]
    errors: wp.array2d[wp.float64],  # [frames, 2] sum of the absolute residuals, and their number
):
    """Write the equations of a frame's points in the motion of the frame, in the axes of each target.

    No ``+=`` on arrays: Warp makes it atomic, which costs more than the sum.
    """
    frame = first + wp.tid()
    begin = bundle.begins[frame]
    count = bundle.begins[frame + 1] - begin
    start = blocks[frame]
    total = wp.float64(0.0)
    number = int(0)
    for index in range(bundle.starts[frame], bundle.starts[frame + 1]):
        own = wp.float64(bundle.held)
        pull = expected_pull(bundle, index)
        for a in range(count):
            slopes[begin + a] = Motion()
            found = look_at_point(bundle, begin + a, index)
            if found.seen:
                weight = weight_of(bundle, found)
                slope = slope_of(found)
                along = slope_nearer(bundle, found, begin + a, index)
                residual = wp.float64(found.color)
                own += weight * along * along
                pull -= weight * along * residual
                slopes[begin + a] = weight * along * slope
                at = start + a * (a + 1) // 2 + a
                matrices[at] = matrices[at] + product(slope, slope, weight)
                sides[begin + a] = sides[begin + a] - weight * residual * slope
                total += wp.abs(residual)
                number += 1
        for a in range(count):
            g = slopes[begin + a]
            if wp.dot(g, g) > _NOTHING:
                sides[begin + a] = sides[begin + a] - (pull / own) * g
                for b in range(a + 1):
                    other = slopes[begin + b]
                    if wp.dot(other, other) > _NOTHING:
                        at = start + a * (a + 1) // 2 + b
                        matrices[at] = matrices[at] - product(g, other, _ONE / own)
    errors[frame, 0] = total
    errors[frame, 1] = wp.float64(number)


@wp.kernel
def nearness_kernel(
    first: int,
    bundle: Bundle,
    motions: wp.array[Motion],  # [pairs] of the frame, in the axes of each target
    largest: float,
    # outputs
    moved: wp.array[float],  # nearness of each point
):
    """Write how near the points of a frame are after the motions, by at most ``largest`` from before."""
    frame = first + wp.tid()
    begin = bundle.begins[frame]
    for index in range(bundle.starts[frame], bundle.starts[frame + 1]):
        own = wp.float64(bundle.held)
        pull = expected_pull(bundle, index)
        for pair in range(begin, bundle.begins[frame + 1]):
            found = look_at_point(bundle, pair, index)
            if found.seen:
                weight = weight_of(bundle, found)
                along = slope_nearer(bundle, found, pair, index)
                residual = wp.float64(found.color) + wp.dot(slope_of(found), motions[pair])
                own += weight * along * along
                pull -= weight * along * residual
        moved[index] = bundle.nearer[index] + wp.clamp(float(pull / own), -largest, largest)
