"""The rays that measure which share of a bright spot a place on the surface sees; see sim.render.shadows."""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false, reportReturnType=false

import warp as wp

from digs_warp.sim.render.lighting import RIM_POINTS, SPOT_POINTS, KeyLights
from digs_warp.sim.render.surface import Surface, is_blocked, smooth_position_at
from digs_warp.sim.render.view import FAR

wp.set_module_options({"enable_backward": False})

# A corner asks every n-th point of a spot; its neighbors ask the others.
TURNS = wp.constant(2)

# The lattice is shrunk by this part of a step: at the edge itself the next triangle may hide the spot.
INSET = wp.constant(0.25)

# For the same reason, rays of a vertex start this part of an edge away from it. More would move the shadow.
VERTEX_INSET = wp.constant(0.015)


@wp.func
def rim_share(surface: Surface, keys: KeyLights, spot: int, origin: wp.vec3) -> float:
    """1 if the rim of a spot and its middle are seen from ``origin``, 0 if none of them is, else a half."""
    first = is_blocked(surface, origin, keys.rims[spot, 0], FAR)
    for p in range(1, RIM_POINTS):
        if is_blocked(surface, origin, keys.rims[spot, p], FAR) != first:
            return 0.5
    return wp.where(first, 0.0, 1.0)


@wp.func
def point_share(surface: Surface, keys: KeyLights, spot: int, turn: int, origin: wp.vec3) -> float:
    """Share of a spot that is seen from ``origin``; ``turn``, 0 to TURNS - 1, says which points are asked."""
    seen = wp.int32(0)
    for p in range(SPOT_POINTS // TURNS):
        if not is_blocked(surface, origin, keys.points[spot, TURNS * p + turn], FAR):
            seen += 1
    return float(seen * TURNS) / float(SPOT_POINTS)


@wp.func
def all_points_share(surface: Surface, keys: KeyLights, spot: int, origin: wp.vec3) -> float:
    """Share of a spot that is seen from ``origin`` by all of its points."""
    total = wp.float32(0.0)
    for turn in range(TURNS):
        total += point_share(surface, keys, spot, turn, origin)
    return total / float(TURNS)


@wp.func
def is_partial(share: float) -> bool:
    """Whether a part of a spot is seen."""
    return share > 0.0 and share < 1.0


@wp.struct
class Place:
    """Where a hit lies on its triangle; on a small one, the weights are those of the vertices."""

    face: int
    normal: wp.vec3  # of the triangle, toward the viewer
    side: int  # 1: that is the triangle's own normal
    outer: int  # 1: it is on the side of the vertex normals
    level: int  # there are 2^level steps along an edge
    i: int  # the corners around it: (i + 1, j), (i, j + 1), and either (i, j) or (i + 1, j + 1)
    j: int
    near: int  # 0 or 1: added to i and j for the third corner
    along: wp.vec3  # weights of the three, in this order


@wp.func
def start_of_rays(surface: Surface, place: Place, u: float, v: float) -> wp.vec3:
    """A place of the triangle, lifted off it."""
    start = smooth_position_at(surface, place.face, place.normal, u, v)
    return start + surface.lift * place.normal


@wp.func
def corner_origin(surface: Surface, place: Place, level: int, i: int, j: int) -> wp.vec3:
    """Start of the rays of a corner."""
    steps = float(1 << level) + INSET
    u = (float(i) + INSET / 3.0) / steps
    v = (float(j) + INSET / 3.0) / steps
    return start_of_rays(surface, place, u, v)


@wp.func
def vertex_origin(surface: Surface, vertex: int, outer: int) -> wp.vec3:
    """Start of the rays of a vertex, on its largest triangle; ``outer``: 1 on the side of the normals."""
    home = surface.homes[vertex]
    face = home // 3
    a = surface.points[surface.corners[3 * face]]
    b = surface.points[surface.corners[3 * face + 1]]
    c = surface.points[surface.corners[3 * face + 2]]
    normal = wp.normalize(wp.cross(b - a, c - a))
    ahead = wp.dot(normal, surface.normals[vertex]) > 0.0
    place = Place()
    place.face = face
    place.normal = wp.where(ahead == (outer == 1), normal, -normal)
    corner = home - 3 * face
    u = wp.where(corner == 0, 1.0 - 2.0 * VERTEX_INSET, VERTEX_INSET)
    v = wp.where(corner == 1, 1.0 - 2.0 * VERTEX_INSET, VERTEX_INSET)
    return start_of_rays(surface, place, u, v)
