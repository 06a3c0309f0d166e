"""The light that leaves a surface point: material, texture, and the environment.

The material model is glTF's metallic-roughness model: a Lambertian base under a GGX coat. A coat's
reflectance is the second half of the split sum in Karis' analytic form ("Physically Based Shading on Mobile",
2014, after Lazarov). Corners are darkened by
occlusion measured at nodes of the mesh, corrected for light that bounces between colored walls (Jimenez et
al., "Practical Realtime Strategies for Accurate Indirect Occlusion", 2016, eq. 20). Bright spots of the
environment cast shadows, in which they have no highlights, and smooth metal reflects the object itself; see
`digs_warp.sim.render.lighting` and `mirrored_light`.
"""

import numpy as np
import warp as wp

from digs_warp.sim.render.hit_material import Look, look_at_hit, matte_color
from digs_warp.sim.render.lighting import (
    PI,
    RIM_POINTS,
    SPOT_RADIUS_DEGREES,
    TWO_PI,
    KeyLights,
    Light,
    diffuse_light,
    key_light,
    specular_light,
)
from digs_warp.sim.render.shadows import Place, seen_share, shadow_place
from digs_warp.sim.render.surface import MIN_COSINE, Surface
from digs_warp.sim.render.surround import (
    boundary_distance,
    is_on_floor,
    openness_on,
    panorama_direction,
    plane_distance,
)
from digs_warp.sim.render.view import FAR, View

# Spots that add less than this share of full white are not worth shadow rays.
FAINT_KEY = wp.constant(0.005)

# Largest angle between a point of a spot and the spot's direction [rad].
SPOT_RADIUS = wp.constant(float(2.0 * np.radians(SPOT_RADIUS_DEGREES)))

# Roughness of the lobes that weight the spots of a highlight.
SHARPEST_LOBE = wp.constant(0.2)
WIDEST_LOBE = wp.constant(0.98)


@wp.func
def lobe_at(cosine: float, alpha2: float) -> float:
    """GGX lobe around the reflected ray, at an angle from it, times that cosine (Karis 2013, n = v = r)."""
    half2 = 0.5 + 0.5 * cosine
    root = half2 * (alpha2 - 1.0) + 1.0
    return wp.max(cosine, 0.0) * alpha2 / (root * root)


@wp.func
def lobe_area(alpha2: float) -> float:
    """Integral of `lobe_at` over all directions; alpha2 below 1."""
    half = 0.5 * (alpha2 - 1.0)
    middle = 0.5 * (alpha2 + 1.0)
    return TWO_PI * alpha2 * (wp.log(alpha2 / middle) + middle / alpha2 - 1.0) / (half * half)


@wp.func
def highlight_of(
    keys: KeyLights, spot: int, mirrored: wp.vec3, alpha2: float, scale: float
) -> float:
    """Light of a spot in the lobe around the reflected ray; 0: too faint to count."""
    strength = scale * keys.strengths[spot]
    nearest = wp.min(wp.dot(mirrored, keys.vectors[spot]) + SPOT_RADIUS, 1.0)
    weight = wp.float32(0.0)
    if strength * lobe_at(nearest, alpha2) > FAINT_KEY:
        for p in range(RIM_POINTS):
            weight += lobe_at(wp.dot(mirrored, keys.rims[spot, p]), alpha2)
    return weight * strength


@wp.struct
class SpotLight:
    """What the bright spots give a hit."""

    diffuse: wp.vec3  # reflected by the matte base
    highlights: float  # share of the spots in the lobe around the reflected ray that the hit sees


@wp.func
def spot_light(
    surface: Surface, light: Light, look: Look, place: Place, mirrored: wp.vec3, reflected: float
) -> SpotLight:
    """Measure the light of the bright spots with shadows; ``reflected``: share of the lobe that is.

    Where a spot hardly matters, openness replaces its rays.
    """
    keys = light.keys
    albedo = matte_color(look)
    brightest = wp.max(albedo)
    alpha2 = wp.pow(wp.clamp(look.roughness, SHARPEST_LOBE, WIDEST_LOBE), 4.0)
    scale = PI * reflected / lobe_area(alpha2)
    is_kept = look.on_table == 1 and surface.table.is_soft == 1
    total = wp.float32(0.0)
    seen = wp.float32(0.0)
    diffuse = wp.vec3(0.0)
    for k in range(keys.count):
        incoming = wp.dot(look.normal, keys.vectors[k])
        highlight = highlight_of(keys, k, mirrored, alpha2, scale)
        total += highlight
        if incoming > 0.0 and (highlight > 0.0 or brightest > FAINT_KEY):
            matters = brightest * incoming * keys.strengths[k] >= FAINT_KEY
            share = look.openness
            if is_kept:
                share = look.spots_seen
            elif matters or highlight > 0.0:
                share = seen_share(surface, keys, k, place)
            seen += highlight * share
            diffuse += (share * incoming) * keys.colors[k]
    found = SpotLight()
    found.diffuse = wp.cw_mul(albedo, diffuse)
    found.highlights = wp.where(total > 0.0, seen / wp.max(total, 1.0e-9), 1.0)
    return found


# Metal smoother than this reflects the object itself; the reflection fades out toward this roughness.
MIRROR_ROUGHNESS = wp.constant(0.45)
MIRROR_METALLIC = wp.constant(0.5)


@wp.func
def with_bounces(openness: float, albedo: float) -> float:
    """Openness for one color channel, corrected for light that bounces between walls of that albedo."""
    a = 2.0404 * albedo - 0.3324
    b = -4.7951 * albedo + 0.6417
    c = 2.7552 * albedo + 0.6903
    return wp.max(openness, ((openness * a + b) * openness + c) * openness)


@wp.func
def coat_reflectance(f0: wp.vec3, roughness: float, cosine: float) -> wp.vec3:
    """Share of the light around the reflected ray that reaches the viewer (Karis 2014)."""
    x = 1.0 - roughness
    y = 0.0425 - 0.0275 * roughness
    z = 1.04 - 0.572 * roughness
    w = 0.022 * roughness - 0.04
    a004 = wp.min(x * x, wp.pow(2.0, -9.28 * cosine)) * x + y
    return (z - 1.04 * a004) * f0 + wp.vec3(wp.max(w + 1.04 * a004, 0.0))


@wp.func
def smooth_diffuse(light: Light, look: Look) -> wp.vec3:
    """Light of the environment without the bright spots, reflected by the matte base."""
    albedo = matte_color(look)
    open_rgb = wp.vec3(
        with_bounces(look.openness, albedo[0]),
        with_bounces(look.openness, albedo[1]),
        with_bounces(look.openness, albedo[2]),
    )
    return wp.cw_mul(wp.cw_mul(albedo, open_rgb), diffuse_light(light, look.normal))


@wp.func
def coat(look: Look, direction: wp.vec3) -> wp.vec3:
    """Share of the reflected light that reaches the viewer."""
    # Interpolated normals may point away from the viewer near a silhouette.
    cosine = wp.clamp(-wp.dot(look.normal, direction), 0.0, 1.0)
    f0 = wp.lerp(wp.vec3(look.reflectance), look.color, look.metallic)
    return coat_reflectance(f0, look.roughness, cosine)


@wp.func
def mirrored_direction(look: Look, direction: wp.vec3) -> wp.vec3:
    """The reflected ray, kept on the outside of the triangle."""
    mirrored = direction - 2.0 * wp.dot(direction, look.normal) * look.normal
    into = wp.min(wp.dot(mirrored, look.facet_normal), 0.0)
    return wp.normalize(mirrored - 2.0 * into * look.facet_normal)


@wp.func
def environment_light(
    view: View,
    surface: Surface,
    light: Light,
    origin: wp.vec3,
    direction: wp.vec3,
    roughness: float,
    spots: float,
) -> wp.vec3:
    """Light of the surround, or of a table top, at the point where a ray from the scene meets it.

    ``spots``: share of the bright spots that is seen.
    """
    down = plane_distance(surface.table, origin, direction, surface.lift)
    if down >= 0.0:
        meets = origin + down * direction
        return openness_on(surface.table, meets[0], meets[1]) * surface.table.glow
    point = origin + boundary_distance(view.boundary, origin, direction) * direction
    if surface.floor.exists == 1 and is_on_floor(view.boundary, point):
        open_share = openness_on(surface.floor, point[0], point[1])
        place = panorama_direction(view.boundary, point)
        return open_share * specular_light(light, place, roughness, 1.0)
    return specular_light(light, panorama_direction(view.boundary, point), roughness, spots)


@wp.func
def shade_once(
    view: View, surface: Surface, light: Light, look: Look, point: wp.vec3, direction: wp.vec3
) -> wp.vec3:
    """Radiance toward the viewer without more rays: openness approximates visibility."""
    keyed = wp.cw_mul(matte_color(look), key_light(light.keys, look.normal))
    total = smooth_diffuse(light, look) + look.openness * keyed
    mirrored = mirrored_direction(look, direction)
    around = environment_light(view, surface, light, point, mirrored, look.roughness, 1.0)
    return look.emission + total + look.openness * wp.cw_mul(coat(look, direction), around)


@wp.func
def mirrored_light(
    view: View,
    surface: Surface,
    light: Light,
    look: Look,
    point: wp.vec3,
    mirrored: wp.vec3,
    cone_width: float,
    spots: float,
) -> wp.vec3:
    """Light around the reflected ray; smooth metal and table tops cast one ray and so reflect the object.

    ``spots``: share of the bright spots in the lobe that is seen.
    """
    around = environment_light(view, surface, light, point, mirrored, look.roughness, spots)
    # The part of the lobe that meets the object itself counts as black.
    blurred = look.openness * around
    reflects = look.metallic >= MIRROR_METALLIC or look.on_table == 1
    if not reflects or look.roughness >= MIRROR_ROUGHNESS:
        return blurred
    origin = point + surface.lift * look.facet_normal
    hit = wp.mesh_query_ray(surface.mesh, origin, mirrored, FAR)
    sharp = around
    if hit.result:
        # The lobe widens the cone: rougher metal reflects a blurred texture.
        spread = view.pixel_cone + look.roughness * look.roughness
        seen = look_at_hit(surface, hit, mirrored, cone_width + hit.t * spread)
        sharp = shade_once(view, surface, light, seen, origin + hit.t * mirrored, mirrored)
    return wp.lerp(sharp, blurred, look.roughness / MIRROR_ROUGHNESS)


@wp.func
def shade(
    view: View,
    surface: Surface,
    light: Light,
    hit: wp.MeshQueryRay,
    look: Look,
    point: wp.vec3,
    direction: wp.vec3,
    distance: float,
    reflected: wp.vec3,
    transmission: float,
) -> wp.vec3:
    """Linear, exposed radiance from the hit toward the viewer.

    ``distance`` from the camera along the ray [m], ``reflected``: the `coat`; the matte base loses the share
    ``transmission`` of its light.
    """
    mirrored = mirrored_direction(look, direction)
    diffuse = smooth_diffuse(light, look)
    spots = wp.float32(1.0)
    place = Place()
    if light.keys.count > 0:
        # Along the slope a pixel covers more of the surface.
        cosine = wp.max(wp.abs(wp.dot(look.facet_normal, direction)), MIN_COSINE)
        across = distance * view.pixel_angle / wp.sqrt(cosine)
        place = shadow_place(surface, hit, look.facet_normal, look.side, across)
        keyed = spot_light(surface, light, look, place, mirrored, wp.max(reflected))
        diffuse += keyed.diffuse
        spots = keyed.highlights
    width = distance * view.pixel_cone
    around = mirrored_light(view, surface, light, look, point, mirrored, width, spots)
    return look.emission + (1.0 - transmission) * diffuse + wp.cw_mul(reflected, around)
