"""The boundary of the surround and the light maps of ground planes, as structs for kernels."""

import warp as wp

from digs_warp.sim.scene.environment import Surround

# Share of a grid's width over which it passes into the next wider one.
BLEND = wp.constant(0.08)


@wp.struct
class LightGrid:
    """Openness, and the visible share of the bright spots, at the nodes of a grid along x and y."""

    values: wp.array2d[wp.vec2]  # [rows along y, columns along x]
    low: wp.vec2  # first node [m]
    size: wp.vec2  # from the first node to the last [m]


@wp.struct
class LightMap:
    """A horizontal plane that things stand on; ``exists`` 0: none."""

    exists: int
    height: float  # [m]
    low: wp.vec2  # corners of the plane [m]
    high: wp.vec2
    fine: LightGrid
    coarse: LightGrid
    smooth: wp.vec3  # light of the environment on the open plane, without the bright spots
    keyed: wp.vec3  # light of the bright spots
    glow: wp.vec3  # radiance of the open plane, where it is known
    is_soft: int  # 1: the spots are so wide that the grids hold their shadows
    material: int  # of the faces on the plane; -1: no faces, part of the surround


@wp.func
def is_over(plane: LightMap, x: float, y: float) -> bool:
    """Whether a place is within the corners of the plane."""
    return x >= plane.low[0] and y >= plane.low[1] and x <= plane.high[0] and y <= plane.high[1]


@wp.func
def grid_weight(grid: LightGrid, x: float, y: float) -> float:
    """1 inside the grid, falling to 0 at its border."""
    u = (x - grid.low[0]) / grid.size[0]
    v = (y - grid.low[1]) / grid.size[1]
    inward = wp.min(wp.min(u, 1.0 - u), wp.min(v, 1.0 - v))
    return wp.clamp(inward / BLEND, 0.0, 1.0)


@wp.func
def grid_value(grid: LightGrid, x: float, y: float) -> wp.vec2:
    """Bilinear value inside the grid."""
    rows = grid.values.shape[0]
    columns = grid.values.shape[1]
    u = wp.clamp((x - grid.low[0]) / grid.size[0], 0.0, 1.0) * float(columns - 1)
    v = wp.clamp((y - grid.low[1]) / grid.size[1], 0.0, 1.0) * float(rows - 1)
    left = wp.min(int(u), columns - 2)
    low = wp.min(int(v), rows - 2)
    fu = u - float(left)
    fv = v - float(low)
    near = wp.lerp(grid.values[low, left], grid.values[low, left + 1], fu)
    far = wp.lerp(grid.values[low + 1, left], grid.values[low + 1, left + 1], fu)
    return wp.lerp(near, far, fv)


@wp.func
def light_on(plane: LightMap, x: float, y: float) -> wp.vec2:
    """Openness of a place of the plane, and the visible share of soft spots; 1 far from everything."""
    value = wp.vec2(1.0, 1.0)
    outer = grid_weight(plane.coarse, x, y)
    if outer > 0.0:
        value = wp.lerp(value, grid_value(plane.coarse, x, y), outer)
        inner = grid_weight(plane.fine, x, y)
        if inner > 0.0:
            value = wp.lerp(value, grid_value(plane.fine, x, y), inner)
    return value


@wp.func
def openness_on(plane: LightMap, x: float, y: float) -> float:
    """Share of the sky that a place of the plane sees, weighted by the cosine; 1 far from everything."""
    return light_on(plane, x, y)[0]


@wp.func
def plane_distance(plane: LightMap, origin: wp.vec3, direction: wp.vec3, slack: float) -> float:
    """Distance along a ray from above to the plane; -1: it does not meet it.

    Rays that start up to ``slack`` [m] below the plane start on it.
    """
    found = wp.float32(-1.0)
    if plane.exists == 1 and direction[2] < 0.0 and origin[2] > plane.height - slack:
        distance = wp.max((plane.height - origin[2]) / direction[2], 0.0)
        x = origin[0] + distance * direction[0]
        y = origin[1] + distance * direction[1]
        if is_over(plane, x, y):
            found = distance
    return found


SPHERE = wp.constant(0)
DOME = wp.constant(1)
ROOM = wp.constant(2)

# Beyond everything [m].
NEVER = wp.constant(1.0e6)

# A point this near to the floor is on it, as a share of the radius.
TOUCH = wp.constant(1.0e-5)


@wp.struct
class Boundary:
    """`Surround` for kernels."""

    shape: int  # SPHERE, DOME or ROOM
    center: wp.vec3
    radius: float  # [m] of the sphere; of a room: half its width
    half_size: wp.vec3  # [m] half the sides of a room; of the others the radius
    floor: float  # [m] height; of a sphere: far below


@wp.func
def unit(vector: wp.vec3) -> wp.vec3:
    """A vector of length 1, of one that is not 0; vector code, which `wp.normalize` is not."""
    return vector / wp.length(vector)


@wp.func
def wall_distance(half: float, place: float, slope: float) -> float:
    """Distance along a ray to the wall that it approaches along one axis."""
    ahead = wp.where(slope > 0.0, half - place, half + place)
    return wp.where(wp.abs(slope) > 1.0e-12, ahead / wp.max(wp.abs(slope), 1.0e-12), NEVER)


@wp.func
def boundary_distance(boundary: Boundary, origin: wp.vec3, direction: wp.vec3) -> float:
    """Distance along the ray to the boundary, from inside."""
    inside = origin - boundary.center
    if boundary.shape == ROOM:
        across = wp.min(
            wall_distance(boundary.half_size[0], inside[0], direction[0]),
            wall_distance(boundary.half_size[1], inside[1], direction[1]),
        )
        upright = wall_distance(boundary.half_size[2], inside[2], direction[2])
        return wp.max(wp.min(across, upright), 0.0)
    along = wp.dot(inside, direction)
    gap = boundary.radius * boundary.radius - wp.dot(inside, inside)
    root = wp.sqrt(along * along + gap)
    # Two forms of the same root, each without cancellation for one sign of `along`.
    distance = wp.where(along > 0.0, gap / (root + along), root - along)
    if boundary.shape == DOME and direction[2] < 0.0:
        # Not behind a ray that starts on the floor.
        distance = wp.min(distance, wp.max((boundary.floor - origin[2]) / direction[2], 0.0))
    return distance


@wp.func
def is_on_floor(boundary: Boundary, point: wp.vec3) -> bool:
    """Whether a point of the boundary belongs to its floor."""
    return point[2] - boundary.floor < TOUCH * boundary.radius


@wp.func
def boundary_normal(boundary: Boundary, point: wp.vec3) -> wp.vec3:
    """Unit normal, toward the inside, at a point of the boundary."""
    inside = point - boundary.center
    if boundary.shape == SPHERE:
        return -wp.normalize(inside)
    if is_on_floor(boundary, point):
        return wp.vec3(0.0, 0.0, 1.0)
    if boundary.shape == DOME:
        return -wp.normalize(inside)
    share = wp.cw_div(inside, boundary.half_size)
    if wp.abs(share[0]) >= wp.abs(share[1]) and wp.abs(share[0]) >= wp.abs(share[2]):
        return wp.vec3(-wp.sign(share[0]), 0.0, 0.0)
    if wp.abs(share[1]) >= wp.abs(share[2]):
        return wp.vec3(0.0, -wp.sign(share[1]), 0.0)
    return wp.vec3(0.0, 0.0, -wp.sign(share[2]))


@wp.func
def panorama_direction(boundary: Boundary, point: wp.vec3) -> wp.vec3:
    """Unit direction in which the panorama shows a point of the boundary."""
    return unit(wp.cw_div(point - boundary.center, boundary.half_size))


@wp.func
def panorama_zoom(boundary: Boundary, point: wp.vec3, direction: wp.vec3, distance: float) -> float:
    """Angle in the panorama that a small angle of a ray covers where it meets the boundary, as a factor.

    On a slanted boundary the longer axis counts. 1 for a sphere: its center is near.
    """
    if boundary.shape == SPHERE:
        return 1.0
    toward = point - boundary.center
    away = wp.length(toward)
    # Along the normal: a wall's and the floor's is an axis. Choices of numbers: LLVM vectorizes no others.
    is_room = boundary.shape == ROOM
    share = wp.cw_div(toward, boundary.half_size)
    x = wp.abs(share[0])
    y = wp.abs(share[1])
    is_x = is_room and x >= wp.max(y, wp.abs(share[2]))
    is_y = is_room and not is_x and y >= wp.abs(share[2])
    is_axis = is_room or is_on_floor(boundary, point)
    far = wp.where(is_x, toward[0], wp.where(is_y, toward[1], toward[2]))
    ahead = wp.where(is_x, direction[0], wp.where(is_y, direction[1], direction[2]))
    far = wp.where(is_axis, far, away)
    ahead = wp.where(is_axis, ahead, wp.dot(direction, toward) / away)
    panorama_cosine = wp.max(wp.abs(far) / away, 1.0e-3)
    return distance / away * wp.max(panorama_cosine / wp.max(wp.abs(ahead), 1.0e-3), 1.0)


def make_boundary(surround: Surround) -> Boundary:
    """Return a surround for kernels."""
    boundary = Boundary()
    boundary.center = wp.vec3(*surround.center)
    boundary.radius = surround.radius
    boundary.half_size = wp.vec3(surround.radius)
    boundary.shape = SPHERE
    boundary.floor = -float(NEVER)
    if surround.floor is not None:
        boundary.shape = ROOM if surround.is_room else DOME
        boundary.floor = surround.floor
    if surround.is_room:
        boundary.half_size = wp.vec3(*surround.half_size)
    return boundary
