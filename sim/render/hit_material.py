"""The material at a hit: color, finish, emission and normal, filtered over the ray's cone."""

import warp as wp

from digs_warp.sim.render.surface import (
    Surface,
    between_corners,
    texture_level,
    texture_position,
    vertex_normal,
    viewer_side,
)
from digs_warp.sim.render.surround import light_on
from digs_warp.sim.render.textures import LINEAR, SRGB, sample_texture

# Twice the value of byte 128, which is zero in normal maps.
MAP_ZERO = wp.constant(256.0 / 255.0)

# Least cosine between up and a level face.
LEVEL = wp.constant(0.999)


@wp.struct
class Look:
    """A surface point for shading."""

    color: wp.vec3  # linear
    emission: wp.vec3
    metallic: float
    reflectance: float  # of a dielectric, at normal incidence
    roughness: float
    normal: wp.vec3  # unit, toward the viewer, with the normal map
    facet_normal: wp.vec3  # of the triangle, toward the viewer
    side: float  # 1: seen from the side of the vertex normals, -1: from the other
    openness: float  # share of the hemisphere that sees the surround
    on_table: int  # 1: the table top on which the objects stand
    spots_seen: float  # there, share of the bright spots if they are soft


@wp.func
def base_color(surface: Surface, hit: wp.MeshQueryRay, uv: wp.vec2, level: float) -> wp.vec3:
    """Linear color of the hit: factor times vertex color times filtered texture."""
    color = between_corners(surface, surface.colors, hit.face, hit.u, hit.v)
    data = surface.data[surface.materials[hit.face]]
    color = wp.cw_mul(color, data.base_color)
    if data.texture >= 0:
        texel = sample_texture(surface.textures, data.texture, uv, level, SRGB)
        color = wp.cw_mul(color, texel)
    return color


@wp.func
def interpolated_openness(surface: Surface, hit: wp.MeshQueryRay, side: float) -> float:
    """Share of the hemisphere on one side (1: the normals', -1: the other) that sees the surround."""
    corner = 3 * hit.face
    u = hit.u
    v = hit.v
    w = 1.0 - u - v
    both = (
        u * (2.0 * u - 1.0) * surface.openness[surface.corners[corner]]
        + v * (2.0 * v - 1.0) * surface.openness[surface.corners[corner + 1]]
        + w * (2.0 * w - 1.0) * surface.openness[surface.corners[corner + 2]]
        + 4.0 * u * v * surface.openness[surface.edges[corner]]
        + 4.0 * v * w * surface.openness[surface.edges[corner + 1]]
        + 4.0 * w * u * surface.openness[surface.edges[corner + 2]]
    )
    # A quadratic between 0 and 1 at its nodes overshoots between them.
    return wp.clamp(wp.where(side > 0.0, both[0], both[1]), 0.0, 1.0)


@wp.func
def mapped_normal(
    surface: Surface, hit: wp.MeshQueryRay, normal: wp.vec3, texture: int, uv: wp.vec2, level: float
) -> wp.vec3:
    """Vertex normal perturbed by a normal map; unchanged where the texture has no direction."""
    tangent = between_corners(surface, surface.tangents, hit.face, hit.u, hit.v)
    tangent -= wp.dot(tangent, normal) * normal
    length = wp.length(tangent)
    if length < 1.0e-3:
        return normal
    tangent = tangent / length
    bitangent = surface.handedness[hit.face] * wp.cross(normal, tangent)
    texel = sample_texture(surface.textures, texture, uv, level, LINEAR)
    x = 2.0 * texel[0] - MAP_ZERO
    y = 2.0 * texel[1] - MAP_ZERO
    z = wp.max(2.0 * texel[2] - MAP_ZERO, 0.05)
    return wp.normalize(x * tangent + y * bitangent + z * normal)


@wp.func
def material_at_hit(
    surface: Surface, hit: wp.MeshQueryRay, direction: wp.vec3, cone_width: float
) -> Look:
    """Collect the look of a hit without its openness; ``cone_width`` as in `look_at_hit`."""
    data = surface.data[surface.materials[hit.face]]
    uv = texture_position(surface, hit)
    level = texture_level(surface, hit, direction, cone_width)
    outward = vertex_normal(surface, hit)
    look = Look()
    look.side = viewer_side(hit, direction, outward)
    if data.normal_texture >= 0:
        outward = mapped_normal(surface, hit, outward, data.normal_texture, uv, level)
    look.normal = look.side * outward
    look.facet_normal = wp.where(wp.dot(hit.normal, direction) > 0.0, -hit.normal, hit.normal)
    look.color = base_color(surface, hit, uv, level)
    look.roughness = data.roughness
    look.metallic = data.metallic
    look.reflectance = data.reflectance
    if data.finish_texture >= 0:
        finish = sample_texture(surface.textures, data.finish_texture, uv, level, LINEAR)
        look.roughness = finish[0]
        look.metallic = finish[1]
    look.emission = data.emission
    if data.emission_texture >= 0:
        glow = sample_texture(surface.textures, data.emission_texture, uv, level, SRGB)
        look.emission = wp.cw_mul(look.emission, glow)
    return look


@wp.func
def look_at_hit(
    surface: Surface, hit: wp.MeshQueryRay, direction: wp.vec3, cone_width: float
) -> Look:
    """Collect the look of a hit; ``cone_width`` is the width of the ray's cone there [m]."""
    look = material_at_hit(surface, hit, direction, cone_width)
    look.openness = interpolated_openness(surface, hit, look.side)
    is_of_table = surface.materials[hit.face] == surface.table.material
    if surface.table.exists == 1 and is_of_table and look.facet_normal[2] > LEVEL:
        point = between_corners(surface, surface.points, hit.face, hit.u, hit.v)
        found = light_on(surface.table, point[0], point[1])
        look.openness = found[0]
        look.spots_seen = found[1]
        look.on_table = 1
    return look


@wp.func
def matte_color(look: Look) -> wp.vec3:
    """Share of the light that arrives which the matte base reflects."""
    return (1.0 - look.metallic) * look.color
