"""Where a frame sees a point of another frame, and what it shows there: shared by both comparisons of poses.

Functions that run inside of kernels; the planes of all frames lie behind one another in one array.
"""

import warp as wp

from digs_warp.geometry.reproject_kernel import agrees, project

wp.set_module_options({"enable_backward": False})


@wp.struct
class Target:
    """Where a frame's pixels are, and its camera.

    ``turn`` and ``shift``: motion of the camera while all rows are read, see `digs_warp.splat.camera_motion`.
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
    _u, v = project(q, target.fx, target.fy, target.cx, target.cy)
    moment = v / float(target.height) - 0.5
    return q - moment * (wp.cross(target.turn, q) + target.shift)


@wp.struct
class Look:
    """What a frame shows where it sees a point.

    Attributes:
        seen: whether it shows the point at all; without, nothing else holds.
        q: the point, in the frame's axes when it reads the row [m].
        u, v: where [px].
        measured: depth there [m].
        color: what the image shows there less what it should show.
        slope: of that, per motion of the point.
    """

    seen: bool
    q: wp.vec3
    u: float
    v: float
    measured: float
    color: float
    slope: wp.vec3


@wp.func
def look(
    middle: wp.vec3,
    value: float,
    target: Target,
    image: wp.array[float],
    depth: wp.array[float],
    hidden: float,
) -> Look:
    """Return what a frame shows of a point.

    Args:
        middle: the point, in the axes of the frame's middle row [m].
        value: what the image should show.
        target: the frame.
        image: pixels of all frames.
        depth: the same [m]; NaN: unknown, and then no point is seen.
        hidden: relative difference of depth from which on another surface is seen.
    """
    found = Look()
    found.seen = False
    if middle[2] <= 0.0:
        return found
    q = at_its_row(middle, target)
    if q[2] <= 0.0:
        return found
    u, v = project(q, target.fx, target.fy, target.cx, target.cy)
    if u < 2.0 or v < 2.0 or u > float(target.width) - 2.0 or v > float(target.height) - 2.0:
        return found
    measured = bilinear(depth, target, u, v)
    if not agrees(q[2], measured, hidden * q[2]):  # also where it is NaN
        return found
    across = bilinear(image, target, u + 0.5, v) - bilinear(image, target, u - 0.5, v)
    down = bilinear(image, target, u, v + 0.5) - bilinear(image, target, u, v - 0.5)
    found.seen = True
    found.q = q
    found.u = u
    found.v = v
    found.measured = measured
    found.color = bilinear(image, target, u, v) - value
    found.slope = across * to_right(q, target) + down * downwards(q, target)
    return found


@wp.func
def to_right(q: wp.vec3, target: Target) -> wp.vec3:
    """Return how far to the right the pixel of a point moves per motion of the point [px/m]."""
    per_z = 1.0 / q[2]
    return wp.vec3(target.fx * per_z, 0.0, -target.fx * q[0] * per_z * per_z)


@wp.func
def downwards(q: wp.vec3, target: Target) -> wp.vec3:
    """Return the same downwards."""
    per_z = 1.0 / q[2]
    return wp.vec3(0.0, target.fy * per_z, -target.fy * q[1] * per_z * per_z)


@wp.func
def row_of(q: wp.vec3, slope: wp.vec3):
    """Return the slope of a residual per motion (w, t) of the frame that the point q belongs to."""
    turn = wp.cross(q, slope)
    return wp.spatial_vector(turn[0], turn[1], turn[2], slope[0], slope[1], slope[2])
