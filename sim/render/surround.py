"""The boundary of the surround, for kernels; see `digs_warp.sim.scene.surround`."""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false

import warp as wp

from digs_warp.sim.scene.surround import Surround

wp.set_module_options({"enable_backward": False})

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
    half_size: wp.vec3  # [m] of a room
    floor: float  # [m] height; of a sphere: far below


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
    inside = point - boundary.center
    if boundary.shape == SPHERE:
        return inside / boundary.radius
    if boundary.shape == ROOM:
        return wp.normalize(wp.cw_div(inside, boundary.half_size))
    return wp.normalize(inside)


@wp.func
def panorama_zoom(boundary: Boundary, point: wp.vec3, direction: wp.vec3, distance: float) -> float:
    """Angle in the panorama that a small angle of a ray covers where it meets the boundary, as a factor.

    On a slanted boundary the longer axis counts. 1 for a sphere: its center is near.
    """
    if boundary.shape == SPHERE:
        return 1.0
    normal = boundary_normal(boundary, point)
    toward = point - boundary.center
    away = wp.length(toward)
    ray_cosine = wp.max(-wp.dot(direction, normal), 1.0e-3)
    panorama_cosine = wp.max(-wp.dot(toward, normal) / away, 1.0e-3)
    return distance / away * wp.max(panorama_cosine / ray_cosine, 1.0)


def make_boundary(surround: Surround) -> Boundary:
    """Return a surround for kernels."""
    boundary = Boundary()
    boundary.center = wp.vec3(*surround.center)
    boundary.radius = surround.radius
    boundary.half_size = wp.vec3(*surround.half_size)
    boundary.shape = SPHERE
    boundary.floor = -float(NEVER)
    if surround.floor is not None:
        boundary.shape = ROOM if surround.is_room else DOME
        boundary.floor = surround.floor
    return boundary
