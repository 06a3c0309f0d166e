"""Shadows of the bright spots: how much of each spot a place on the surface sees, kept for all later rays.

The share is known at the vertices of small triangles, and at the corners of a lattice on larger ones, one or
two pixels apart. It is linear between them. It is measured only where a few rays say that a penumbra is near.
It belongs to the surface: both eyes and all frames find the same shadow, without noise of their own.
"""

import numpy as np
import warp as wp

from digs_warp.sim.render.lighting import RIM_POINTS, SPOT_POINTS, KeyLights
from digs_warp.sim.render.surface import Surface, is_blocked, smooth_position_at
from digs_warp.sim.render.view import FAR
from digs_warp.sim.scene.scene import Scene

# Shares that are kept, in blocks of neighbors and sets of blocks; newer ones replace older ones.
# A word is 8 bytes.
BLOCK = wp.constant(16)
WAYS = wp.constant(4)
SET = wp.constant(64)
STORE_WORDS = 1 << 23

# A triangle has up to 2^13 steps along an edge: places 0 to 8192 take 14 bits of a key.
FINEST = wp.constant(13)

# There is about one corner for a pixel; on slivers fewer, with steps of up to this many pixels.
CORNERS_PER_PIXEL = wp.constant(1.0)
LONG_STEP = wp.constant(4.0)

# On triangles with up to 2^SMALL steps the share is linear between the vertices, which neighbors share.
SMALL = wp.constant(1)

# A share is stored as 1 to 255: no word of the store is 0 but the empty ones.
STEPS = wp.constant(254.0)
STEPS_MASK = wp.constant(wp.uint64(0xFF))
TAG_MASK = wp.constant(wp.uint64(0xFFFFFFFFFFFFFF00))

# The finalizer of SplitMix64 (Steele et al., "Fast splittable pseudorandom number generators", 2014): it maps
# different keys to different words.
MIX_1 = wp.constant(wp.uint64(0xBF58476D1CE4E5B9))
MIX_2 = wp.constant(wp.uint64(0x94D049BB133111EB))


def prepare_shadows(scene: Scene, surface: Surface, spots: int) -> None:
    """Make the memory of `seen_share` for a scene with that many spots; sets fields of ``surface``."""
    words = STORE_WORDS if spots else SET
    surface.shadows = wp.zeros(words, dtype=wp.uint64, device="cpu")
    shape = (2 * len(scene.vertices), max(spots, 1))
    surface.vertex_shadows = wp.zeros(shape, dtype=wp.uint8, device="cpu")
    a, b, c = np.moveaxis(scene.vertices[scene.faces].astype(np.float64), 1, 0)
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.linalg.norm([b - a, c - b, a - c], axis=-1).max(axis=0)
    edges = np.maximum(np.sqrt(doubled), longest / LONG_STEP)
    surface.edge_sizes = wp.array(edges.astype(np.float32), dtype=float, device="cpu")
    homes = np.zeros(len(scene.vertices), np.int32)
    smallest_first = np.argsort(doubled, kind="stable")
    # The last write to a vertex wins: that of its largest face.
    homes[scene.faces[smallest_first]] = 3 * smallest_first[:, None] + np.arange(3)
    surface.homes = wp.array(homes, dtype=int, device="cpu")


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


@wp.func
def mixed(key: wp.uint64) -> wp.uint64:
    """A number that looks random, different for every key."""
    a = (key ^ (key >> wp.uint64(30))) * MIX_1
    b = (a ^ (a >> wp.uint64(27))) * MIX_2
    return b ^ (b >> wp.uint64(31))


@wp.func
def shadow_place(
    surface: Surface, hit: wp.MeshQueryRay, normal: wp.vec3, side: float, width: float
) -> Place:
    """The place of a hit.

    ``normal`` of the triangle toward the viewer, ``side``: 1 if that is the side of the vertex normals,
    ``width`` of a pixel there [m].
    """
    place = Place()
    place.face = hit.face
    place.normal = normal
    place.side = wp.where(wp.dot(hit.normal, normal) > 0.0, 1, 0)
    place.outer = wp.where(side > 0.0, 1, 0)
    step = wp.max(width, 1.0e-9) / wp.sqrt(CORNERS_PER_PIXEL)
    level = wp.log2(surface.edge_sizes[hit.face] / step)
    place.level = int(wp.round(wp.clamp(level, 0.0, float(FINEST))))
    if place.level <= SMALL:
        place.along = wp.vec3(hit.u, hit.v, 1.0 - hit.u - hit.v)
        return place
    steps = 1 << place.level
    x = wp.clamp(hit.u * (float(steps) + INSET) - INSET / 3.0, 0.0, float(steps))
    y = wp.clamp(hit.v * (float(steps) + INSET) - INSET / 3.0, 0.0, float(steps) - x)
    place.i = wp.min(int(x), steps - 1)
    place.j = wp.min(int(y), steps - 1 - place.i)
    fx = x - float(place.i)
    fy = y - float(place.j)
    place.along = wp.vec3(fx, fy, 1.0 - fx - fy)
    if fx + fy > 1.0:
        place.near = 1
        place.along = wp.vec3(1.0 - fy, 1.0 - fx, fx + fy - 1.0)
    return place


@wp.struct
class Word:
    """Where a share is kept."""

    tag: wp.uint64  # the upper bits of the word
    slot: int
    share: float  # negative: it is not kept yet


@wp.func
def kept_word(surface: Surface, group: int, kind: int, row: int, column: int, within: int) -> Word:
    """Look up a share; ``kind`` says of what, ``within`` is its place in the block.

    The store is exact: the set of a word and its upper 56 bits together are the whole mixed key, and its
    place in the block is the rest.
    """
    key = (wp.uint64(group) << wp.uint64(12)) | wp.uint64(row)
    key = (key << wp.uint64(12)) | wp.uint64(column)
    key = (key << wp.uint64(9)) | wp.uint64(kind)
    mix = mixed(key)
    first = int(mix & wp.uint64(surface.shadows.shape[0] // SET - 1)) * SET + within
    word = Word()
    word.tag = mix & TAG_MASK
    word.share = -1.0
    word.slot = first + (int(mix >> wp.uint64(60)) & (WAYS - 1)) * BLOCK
    for way in range(WAYS):
        found = surface.shadows[first + way * BLOCK]
        if found == wp.uint64(0):
            word.slot = first + way * BLOCK
            break
        if (found & TAG_MASK) == word.tag:
            word.share = (float(found & STEPS_MASK) - 1.0) / STEPS
            break
    return word


@wp.func
def keep(surface: Surface, word: Word, share: float) -> float:
    """Keep a share, and return it as it is kept. It is written at once: threads cannot disturb each other."""
    rounded = wp.round(STEPS * share)
    surface.shadows[word.slot] = word.tag | wp.uint64(int(rounded) + 1)
    return rounded / STEPS


@wp.func
def word_of_corner(
    surface: Surface, place: Place, spot: int, level: int, i: int, j: int, asks_rim: int
) -> Word:
    """Look up a corner of the lattice of that level, or what the rim says there."""
    kind = (((level << 3) | spot) << 2) | (place.side << 1) | asks_rim
    within = ((i & 3) << 2) | (j & 3)
    return kept_word(surface, place.face, kind, i >> 2, j >> 2, within)


@wp.func
def rim_at_corner(
    surface: Surface, keys: KeyLights, spot: int, place: Place, level: int, i: int, j: int
) -> float:
    """`rim_share` at a corner."""
    word = word_of_corner(surface, place, spot, level, i, j, 1)
    if word.share >= 0.0:
        return word.share
    origin = corner_origin(surface, place, level, i, j)
    return keep(surface, word, rim_share(surface, keys, spot, origin))


@wp.func
def measured_at_vertex(
    surface: Surface, keys: KeyLights, spot: int, vertex: int, outer: int
) -> int:
    """Measure the share of a spot that a vertex sees, and keep it; the byte that is kept."""
    origin = vertex_origin(surface, vertex, outer)
    share = rim_share(surface, keys, spot, origin)
    if is_partial(share):
        share = wp.float32(0.0)
        for turn in range(TURNS):
            share += point_share(surface, keys, spot, turn, origin) / float(TURNS)
    kept = int(wp.round(STEPS * share)) + 1
    surface.vertex_shadows[2 * vertex + outer, spot] = wp.uint8(kept)
    return kept


@wp.func
def kept_at_vertex(surface: Surface, spot: int, vertex: int, outer: int) -> int:
    """The byte in which the share that a vertex sees is kept; 0: it is unknown."""
    return int(surface.vertex_shadows[2 * vertex + outer, spot])


@wp.func
def measured_at_corner(
    surface: Surface, keys: KeyLights, spot: int, place: Place, word: Word, i: int, j: int
) -> float:
    """Measure the share of a spot that a corner of the lattice sees, and keep it in that word.

    Where the rim says the same on both sides, at corners twice as far apart, that is the answer. Only the
    others ask many points.
    """
    # A corner lies midway between two of the coarser lattice, or is one.
    level = place.level - 1
    share = rim_at_corner(surface, keys, spot, place, level, i >> 1, (j + 1) >> 1)
    if (i & 1) + (j & 1) > 0 and not is_partial(share):
        other = rim_at_corner(surface, keys, spot, place, level, (i + 1) >> 1, j >> 1)
        share = wp.where(other == share, share, 0.5)
    if is_partial(share):
        origin = corner_origin(surface, place, place.level, i, j)
        share = point_share(surface, keys, spot, (i + 2 * j) % TURNS, origin)
    return keep(surface, word, share)


@wp.func
def seen_from_vertices(surface: Surface, keys: KeyLights, spot: int, place: Place) -> float:
    """`seen_share` on a small triangle."""
    first = surface.corners[3 * place.face]
    second = surface.corners[3 * place.face + 1]
    third = surface.corners[3 * place.face + 2]
    a = kept_at_vertex(surface, spot, first, place.outer)
    b = kept_at_vertex(surface, spot, second, place.outer)
    c = kept_at_vertex(surface, spot, third, place.outer)
    if a == 0:
        a = measured_at_vertex(surface, keys, spot, first, place.outer)
    if b == 0:
        b = measured_at_vertex(surface, keys, spot, second, place.outer)
    if c == 0:
        c = measured_at_vertex(surface, keys, spot, third, place.outer)
    return (
        place.along[0] * ((float(a) - 1.0) / STEPS)
        + place.along[1] * ((float(b) - 1.0) / STEPS)
        + place.along[2] * ((float(c) - 1.0) / STEPS)
    )


@wp.func
def seen_from_corners(surface: Surface, keys: KeyLights, spot: int, place: Place) -> float:
    """`seen_share` on a triangle with a lattice."""
    i = place.i
    j = place.j
    n = place.near
    a = word_of_corner(surface, place, spot, place.level, i + 1, j, 0)
    b = word_of_corner(surface, place, spot, place.level, i, j + 1, 0)
    c = word_of_corner(surface, place, spot, place.level, i + n, j + n, 0)
    if a.share < 0.0:
        a.share = measured_at_corner(surface, keys, spot, place, a, i + 1, j)
    if b.share < 0.0:
        b.share = measured_at_corner(surface, keys, spot, place, b, i, j + 1)
    if c.share < 0.0:
        c.share = measured_at_corner(surface, keys, spot, place, c, i + n, j + n)
    return place.along[0] * a.share + place.along[1] * b.share + place.along[2] * c.share


@wp.func
def seen_share(surface: Surface, keys: KeyLights, spot: int, place: Place) -> float:
    """Share of a spot that is seen from a place of a triangle, from memory or measured now.

    Mostly all three shares are in memory. What measures is therefore called for each corner by itself: a
    function with a single caller would become part of it, and the rest too large to become part of shading.
    """
    if place.level <= SMALL:
        return seen_from_vertices(surface, keys, spot, place)
    return seen_from_corners(surface, keys, spot, place)
