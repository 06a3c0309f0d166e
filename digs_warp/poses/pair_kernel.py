"""Kernel of `digs_warp.poses.equations`: the normal equations of one pair of frames, one thread per pair.

A point q of the source frame, in the target's axes, should have the value that the target shows there, and
lie at the depth that the target measured; of depth, the inverse is compared, for a stereo camera errs in it
by about the same amount everywhere. Both residuals are linear in a small motion c = (w, t) of the
source frame, q' = q + t + w x q. Sums are made in the order of the points, so they do not depend on the
number of threads.
"""

import warp as wp

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
class Target:
    """Where a frame's pixels are, and its camera.

    ``turn`` and ``shift``: motion of the camera while all rows are read, see `digs_warp.splat.row_motion`.
    """

    offset: int
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    turn: wp.vec3
    shift: wp.vec3


@wp.struct
class Limits:
    """What counts: a residual as large as ``color`` or ``depth`` counts half."""

    color: float
    depth: float  # [1/m]
    hidden: float  # relative difference of depth from which on another surface is seen


@wp.func
def bilinear(plane: wp.array[float], target: Target, u: float, v: float) -> float:
    """Return the value at pixel (u, v), which lies at least a pixel inside the rim."""
    x = wp.floor(u - 0.5)
    y = wp.floor(v - 0.5)
    a = u - 0.5 - x
    b = v - 0.5 - y
    at = target.offset + int(y) * target.width + int(x)
    top = plane[at] * (1.0 - a) + plane[at + 1] * a
    below = plane[at + target.width] * (1.0 - a) + plane[at + target.width + 1] * a
    return top * (1.0 - b) + below * b


@wp.func
def at_its_row(q: wp.vec3, target: Target) -> wp.vec3:
    """Return the point in the axes that the target's camera has when it reads the point's row."""
    moment = (target.fy * q[1] / q[2] + target.cy) / float(target.height) - 0.5
    return q - moment * (wp.cross(target.turn, q) + target.shift)


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
    found = Sums()
    for index in range(starts[source], starts[source + 1]):
        middle = wp.transform_point(motion, points[index])
        if middle[2] <= 0.0:
            continue
        q = at_its_row(middle, target)
        if q[2] <= 0.0:
            continue
        per_z = 1.0 / q[2]
        u = target.fx * q[0] * per_z + target.cx
        v = target.fy * q[1] * per_z + target.cy
        if u < 2.0 or v < 2.0 or u > float(target.width) - 2.0 or v > float(target.height) - 2.0:
            continue
        measured = bilinear(depth, target, u, v)
        if not wp.abs(q[2] - measured) * per_z < limits.hidden:  # also where it is NaN
            continue
        apart = 1.0 / measured - per_z
        # The pixel's motion per motion of the point.
        du = wp.vec3(target.fx * per_z, 0.0, -target.fx * q[0] * per_z * per_z)
        dv = wp.vec3(0.0, target.fy * per_z, -target.fy * q[1] * per_z * per_z)
        across = bilinear(image, target, u + 0.5, v) - bilinear(image, target, u - 0.5, v)
        down = bilinear(image, target, u, v + 0.5) - bilinear(image, target, u, v - 0.5)
        color = bilinear(image, target, u, v) - values[index]
        slope = across * du + down * dv
        ratio = color / limits.color
        weight = 1.0 / (limits.color * limits.color * (1.0 + ratio * ratio))
        found[_COLOR_SUM] += wp.float64(wp.abs(color))
        found[_COLOR_COUNT] += wp.float64(1.0)
        right = bilinear(depth, target, u + 0.5, v) - bilinear(depth, target, u - 0.5, v)
        below = bilinear(depth, target, u, v + 0.5) - bilinear(depth, target, u, v - 0.5)
        away = wp.vec3(0.0, 0.0, 0.0)
        trust = float(0.0)
        if right == right and below == below:
            ratio = apart / limits.depth
            trust = 1.0 / (limits.depth * limits.depth * (1.0 + ratio * ratio))
            nearer = -1.0 / (measured * measured)
            away = wp.vec3(0.0, 0.0, per_z * per_z) + nearer * (right * du + below * dv)
            found[_DEPTH_SUM] += wp.float64(wp.abs(apart))
            found[_DEPTH_COUNT] += wp.float64(1.0)
        found += equations(q, slope, color, weight, away, apart, trust)
    for column in range(_COLUMNS):
        sums[pair, column] = found[column]


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


@wp.func
def row_of(q: wp.vec3, slope: wp.vec3):
    """Return the slope of a residual per motion (w, t) of the source frame."""
    turn = wp.cross(q, slope)
    return wp.spatial_vector(turn[0], turn[1], turn[2], slope[0], slope[1], slope[2])
