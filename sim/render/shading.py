"""How a surface point looks: material, texture, and the light of the environment.

The material model is glTF's metallic-roughness model: a Lambertian base under a GGX coat. The coat's
reflectance is the second half of the split sum in Karis' analytic form ("Physically Based Shading on
Mobile", 2014, after Lazarov). Corners are darkened by occlusion measured per vertex, with the bounces
between coloured walls put back (Jimenez et al., "Practical Realtime Strategies for Accurate Indirect
Occlusion", 2016, eq. 20).
"""

# Kernel code is a language of its own; these checks misread it.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false

import warp as wp

from sim.render.lighting import Light, diffuse_light, specular_light
from sim.render.surface import (
    Surface,
    texture_level,
    texture_position,
    vertex_normal,
    viewer_side,
)
from sim.render.textures import SRGB, sample_texture

wp.set_module_options({"enable_backward": False})

# Reflectance of glass, plastic and paint at normal incidence.
DIELECTRIC_REFLECTANCE = wp.constant(0.04)


@wp.func
def base_color(surface: Surface, hit: wp.MeshQueryRay, uv: wp.vec2, level: float) -> wp.vec3:
    """Linear colour of the hit: factor times vertex colour times filtered texture."""
    corner = 3 * hit.face
    w = 1.0 - hit.u - hit.v
    color = (
        hit.u * surface.colors[surface.corners[corner]]
        + hit.v * surface.colors[surface.corners[corner + 1]]
        + w * surface.colors[surface.corners[corner + 2]]
    )
    data = surface.data[surface.materials[hit.face]]
    color = wp.cw_mul(color, data.base_color)
    if data.color_texture >= 0:
        texel = sample_texture(surface.textures, data.color_texture, uv, level, SRGB)
        color = wp.cw_mul(color, texel)
    return color


@wp.func
def interpolated_openness(surface: Surface, hit: wp.MeshQueryRay, side: float) -> float:
    """Share of the hemisphere on one side (1: the normals', -1: the other) that sees the surround."""
    corner = 3 * hit.face
    w = 1.0 - hit.u - hit.v
    both = (
        hit.u * surface.openness[surface.corners[corner]]
        + hit.v * surface.openness[surface.corners[corner + 1]]
        + w * surface.openness[surface.corners[corner + 2]]
    )
    return wp.where(side > 0.0, both[0], both[1])


@wp.func
def with_bounces(openness: float, albedo: float) -> float:
    """Openness for one colour channel after light bounced between walls of that albedo."""
    a = 2.0404 * albedo - 0.3324
    b = -4.7951 * albedo + 0.6417
    c = 2.7552 * albedo + 0.6903
    return wp.max(openness, ((openness * a + b) * openness + c) * openness)


@wp.func
def coat_reflectance(f0: wp.vec3, roughness: float, cosine: float) -> wp.vec3:
    """Share of the light around the mirrored ray that reaches the viewer (Karis 2014)."""
    x = 1.0 - roughness
    y = 0.0425 - 0.0275 * roughness
    z = 1.04 - 0.572 * roughness
    w = 0.022 * roughness - 0.04
    a004 = wp.min(x * x, wp.pow(2.0, -9.28 * cosine)) * x + y
    return (z - 1.04 * a004) * f0 + wp.vec3(wp.max(w + 1.04 * a004, 0.0))


@wp.func
def shade(
    surface: Surface, light: Light, hit: wp.MeshQueryRay, direction: wp.vec3, cone_width: float
) -> wp.vec3:
    """Linear, exposed radiance that leaves the hit toward the viewer."""
    outward = vertex_normal(surface, hit)
    side = viewer_side(hit, direction, outward)
    normal = side * outward
    uv = texture_position(surface, hit)
    level = texture_level(surface, hit, direction, cone_width)
    color = base_color(surface, hit, uv, level)
    data = surface.data[surface.materials[hit.face]]
    metallic = data.metallic
    roughness = data.roughness
    openness = interpolated_openness(surface, hit, side)

    albedo = (1.0 - metallic) * color
    open_rgb = wp.vec3(
        with_bounces(openness, albedo[0]),
        with_bounces(openness, albedo[1]),
        with_bounces(openness, albedo[2]),
    )
    diffuse = wp.cw_mul(wp.cw_mul(albedo, open_rgb), diffuse_light(light, normal))

    # Interpolated normals may point away from the viewer near a silhouette.
    cosine = wp.clamp(-wp.dot(normal, direction), 0.0, 1.0)
    f0 = wp.lerp(wp.vec3(DIELECTRIC_REFLECTANCE), color, metallic)
    reflected = wp.normalize(direction - 2.0 * wp.dot(direction, normal) * normal)
    coat = coat_reflectance(f0, roughness, cosine)
    # The part of the lobe that meets the object itself shows its dim side, here: nothing.
    return diffuse + openness * wp.cw_mul(coat, specular_light(light, reflected, roughness))
