"""Kernel of `photometric_alignment`: those of one pair of frames, one thread per pair.

A point q of the source frame, in the target's axes, should have the value that the target shows there, and
lie at the depth that the target measured; of depth, the inverse is compared, for a stereo camera errs in it
by about the same amount everywhere. Both residuals are linear in a small motion c = (w, t) of the
source frame, q' = q + t + w x q. Sums are made in the order of the points, so they do not depend on the
number of threads.
"""

import warp as wp

from digs_warp.poses.lookup import Target, bilinear, downwards, look, row_of, to_right

wp.set_module_options({"enable_backward": False})

# Columns of the result: the upper triangle of the 6 x 6 matrix, the right side from SIDE on, and of both
# errors the sum of the absolute values and their number.
SIDE = 21
COLOR_SUM, COLOR_COUNT, DEPTH_SUM, DEPTH_COUNT = 27, 28, 29, 30
COLUMNS = 31

Sums = wp.types.vector(length=COLUMNS, dtype=wp.float64)

_COLUMNS = wp.constant(COLUMNS)
_SIDE = wp.constant(SIDE)
_COLOR_SUM = wp.constant(COLOR_SUM)
_COLOR_COUNT = wp.constant(COLOR_COUNT)
_DEPTH_SUM = wp.constant(DEPTH_SUM)
_DEPTH_COUNT = wp.constant(DEPTH_COUNT)


@wp.struct
class Limits:
    """What counts: a residual as large as ``color`` or ``depth`` counts half."""

    color: float
    depth: float  # [1/m]
    hidden: float  # relative difference of depth from which on another surface is seen


@wp.kernel
def pair_kernel(
    first: int,
    sources: wp.array[int],  # [pairs]
    targets: wp.array[int],  # [pairs]
    target_from_source: wp.array[wp.mat44],  # [pairs]
    starts: wp.array[int],  # [frames + 1] first point of each frame
    points: wp.array[wp.vec3],  # in the axes of their frame [m]
    values: wp.array[float],  # of the points
    frames: wp.array[Target],
    image: wp.array[float],  # pixels of all frames
    depth: wp.array[float],  # the same, NaN: unknown
    limits: Limits,
    # outputs
    sums: wp.array2d[wp.float64],  # [pairs, COLUMNS]
):
    """Write the sums of a pair; a pair without a common point has zeros."""
    pair = first + wp.tid()
    source = sources[pair]
    target = frames[targets[pair]]
    motion = target_from_source[pair]
    sums_of_pair = Sums()
    for index in range(starts[source], starts[source + 1]):
        middle = wp.transform_point(motion, points[index])
        found = look(middle, values[index], target, image, depth, limits.hidden)
        if not found.seen:
            continue
        ratio = found.color / limits.color
        weight = 1.0 / (limits.color * limits.color * (1.0 + ratio * ratio))
        sums_of_pair[_COLOR_SUM] += wp.float64(wp.abs(found.color))
        sums_of_pair[_COLOR_COUNT] += wp.float64(1.0)
        u = found.u
        v = found.v
        per_z = 1.0 / found.q[2]
        apart = 1.0 / found.measured - per_z
        right = bilinear(depth, target, u + 0.5, v) - bilinear(depth, target, u - 0.5, v)
        below = bilinear(depth, target, u, v + 0.5) - bilinear(depth, target, u, v - 0.5)
        away = wp.vec3(0.0, 0.0, 0.0)
        trust = float(0.0)
        if right == right and below == below:
            ratio = apart / limits.depth
            trust = 1.0 / (limits.depth * limits.depth * (1.0 + ratio * ratio))
            nearer = -1.0 / (found.measured * found.measured)
            du = to_right(found.q, target)
            dv = downwards(found.q, target)
            away = wp.vec3(0.0, 0.0, per_z * per_z) + nearer * (right * du + below * dv)
            sums_of_pair[_DEPTH_SUM] += wp.float64(wp.abs(apart))
            sums_of_pair[_DEPTH_COUNT] += wp.float64(1.0)
        sums_of_pair += equations(found.q, found.slope, found.color, weight, away, apart, trust)
    for column in range(_COLUMNS):
        sums[pair, column] = sums_of_pair[column]


@wp.func
def equations(
    q: wp.vec3,
    slope: wp.vec3,
    color: float,
    weight: float,
    away: wp.vec3,
    apart: float,
    trust: float,
):
    """Return what both residuals add; ``slope`` and ``away`` are per motion of the point q."""
    sums = Sums()
    a = row_of(q, slope)
    b = row_of(q, away)
    column = int(0)
    for i in range(6):
        of_color = weight * a[i]
        of_depth = trust * b[i]
        for j in range(i, 6):
            sums[column] = wp.float64(of_color * a[j] + of_depth * b[j])
            column += 1
        sums[_SIDE + i] = -wp.float64(of_color * color + of_depth * apart)
    return sums
