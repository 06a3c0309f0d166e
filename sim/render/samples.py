"""Samples of a photograph: a ray followed through an opaque scene, or through glass to the surround."""

import warp as wp

from digs_warp.sim.render.ground_light import has_sharp_shadows, soft_floor_share
from digs_warp.sim.render.hit_material import look_at_hit
from digs_warp.sim.render.lighting import Light, sample_panorama
from digs_warp.sim.render.shading import coat, coat_at, shade
from digs_warp.sim.render.surface import (
    MAX_LAYERS,
    Surface,
    is_see_through,
    opacity_at,
    texture_level,
    transmission_at,
)
from digs_warp.sim.render.surround import (
    SPHERE,
    boundary_distance,
    is_on_floor,
    panorama_direction,
    panorama_zoom,
)
from digs_warp.sim.render.view import FAR, View

wp.set_module_options({"enable_backward": False})

# Upper limit of a sample, as a multiple of full white.
SAMPLE_LIMIT = wp.constant(4.0)

# A ray that carries less than this share of the light ends.
FAINT = wp.constant(0.004)


# A bent ray leaves the triangle at least this steeply: interpolated normals may send it along or back.
LEAST_SLOPE = wp.constant(1.0e-3)


@wp.struct
class Bend:
    """The ray behind the surface."""

    direction: wp.vec3  # unit
    is_reflected: bool  # all of it: total internal reflection
    cosine: float  # between the ray outside the body and the normal


@wp.func
def bend(
    direction: wp.vec3, normal: wp.vec3, facet_normal: wp.vec3, ior: float, enters: bool
) -> Bend:
    """Snell's law, and total internal reflection where it has no solution.

    Both normals point against the ray: ``normal`` of the smooth surface, ``facet_normal`` of the triangle.
    """
    ratio = wp.where(enters, 1.0 / ior, ior)
    cosine = wp.clamp(-wp.dot(direction, normal), 0.0, 1.0)
    behind2 = 1.0 - ratio * ratio * (1.0 - cosine * cosine)
    result = Bend()
    away = -facet_normal
    if behind2 > 0.0:
        behind = wp.sqrt(behind2)
        result.direction = ratio * direction + (ratio * cosine - behind) * normal
        result.cosine = wp.where(enters, cosine, behind)
    else:
        result.is_reflected = True
        result.direction = direction + 2.0 * cosine * normal
        away = facet_normal
    missing = wp.max(LEAST_SLOPE - wp.dot(result.direction, away), 0.0)
    result.direction = wp.normalize(result.direction + missing * away)
    return result


@wp.func
def seen_surround(
    view: View,
    surface: Surface,
    light: Light,
    center: wp.vec3,
    direction: wp.vec3,
    level: float,
    passing: wp.vec3,
) -> wp.vec3:
    """The panorama where a ray from the camera meets the surround, times the weight of its samples.

    It is as bright as the objects leave the floor, but for sharp shadows, which are in the weight.
    ``level``: of the pyramid, that fits a pixel of a camera in the panorama's place.
    """
    distance = boundary_distance(view.boundary, center, direction)
    point = center + distance * direction
    fitting = level
    if view.boundary.shape != SPHERE:
        fitting += wp.log2(panorama_zoom(view.boundary, point, direction, distance))
    place = panorama_direction(view.boundary, point)
    seen = sample_panorama(light.panorama, place, wp.max(fitting, 0.0))
    seen = wp.cw_mul(passing, wp.min(seen, wp.vec3(SAMPLE_LIMIT)))
    floor = surface.floor
    if floor.exists == 1 and not has_sharp_shadows(floor) and is_on_floor(view.boundary, point):
        seen = wp.cw_mul(seen, soft_floor_share(floor, point))
    return seen


@wp.struct
class Sample:
    """The result of one ray."""

    color: wp.vec3  # of the scene
    passing: wp.vec3  # share of the surround's light that passes through
    covered: float  # 1: it met an object


@wp.func
def covers(surface: Surface, face: int) -> float:
    """1 if a face belongs to an object, 0 for furniture."""
    return wp.where(surface.objects[face] > 0, 1.0, 0.0)


@wp.func
def solid_sample(view: View, surface: Surface, light: Light, direction: wp.vec3) -> Sample:
    """Follow a ray through an opaque scene."""
    sample = Sample()
    sample.passing = wp.vec3(1.0)
    hit = wp.mesh_query_ray(surface.mesh, view.center, direction, FAR)
    if hit.result:
        sample.passing = wp.vec3(0.0)
        look = look_at_hit(surface, hit, direction, hit.t * view.pixel_cone)
        point = view.center + hit.t * direction
        shine = coat(look, direction)
        sample.color = shade(view, surface, light, hit, look, point, direction, hit.t, shine, 0.0)
        sample.covered = covers(surface, hit.face)
    return sample


@wp.func
def layered_sample(
    view: View, surface: Surface, light: Light, direction: wp.vec3, surround_level: float
) -> Sample:
    """Follow a ray through transparent walls, front to back: straight on if thin, bent by bodies.

    What glass reflects on its inner side is taken from the surround. A ray that was bent looks up the
    surround itself; ``surround_level`` is that of a `Track`.
    """
    sample = Sample()
    sample.passing = wp.vec3(1.0)
    start = view.center
    heading = direction
    traveled = wp.float32(0.0)  # from the camera to the start
    absorption = wp.vec3(0.0)  # of what surrounds the ray
    was_bent = wp.bool(False)
    for _layer in range(MAX_LAYERS):
        hit = wp.mesh_query_ray(surface.mesh, start, heading, FAR)
        if not hit.result:
            break
        distance = traveled + hit.t
        point = start + hit.t * heading
        width = distance * view.pixel_cone
        opacity = wp.float32(1.0)
        transmission = wp.float32(0.0)
        data = surface.data[surface.materials[hit.face]]
        if is_see_through(surface, hit):
            texture = texture_level(surface, hit, heading, width)
            opacity = opacity_at(surface, hit, texture)
            transmission = transmission_at(surface, hit, texture)
        if was_bent:
            for c in range(3):
                sample.passing[c] = sample.passing[c] * wp.exp(-absorption[c] * hit.t)
        behind = Bend()
        behind.direction = heading
        aside = wp.vec3(0.0)
        if opacity > 0.0:
            look = look_at_hit(surface, hit, heading, width)
            shine = coat(look, heading)
            if data.bends == 1 and transmission > 0.0:
                enters = look.side > 0.0
                behind = bend(heading, look.normal, look.facet_normal, data.ior, enters)
                shine = coat_at(look, behind.cosine)
                aside = (
                    wp.where(behind.is_reflected, surface.step, -surface.step) * look.facet_normal
                )
                if not behind.is_reflected:
                    absorption = wp.where(enters, data.absorption, wp.vec3(0.0))
                was_bent = True
            if not behind.is_reflected:
                seen = shade(
                    view, surface, light, hit, look, point, heading, distance, shine, transmission
                )
                sample.color = sample.color + opacity * wp.cw_mul(sample.passing, seen)
                body = transmission * (1.0 - look.metallic) * look.color
                clear = wp.cw_mul(body, wp.vec3(1.0) - shine)
                through = wp.vec3(1.0 - opacity) + opacity * clear
                sample.passing = wp.cw_mul(sample.passing, through)
            sample.covered = wp.max(sample.covered, covers(surface, hit.face))
        if wp.max(sample.passing) < FAINT:
            sample.passing = wp.vec3(0.0)
            break
        heading = behind.direction
        start = point + surface.step * heading + aside
        traveled = distance + surface.step
    if was_bent and wp.max(sample.passing) > 0.0:
        sample.color = sample.color + seen_surround(
            view, surface, light, start, heading, surround_level, sample.passing
        )
        sample.passing = wp.vec3(0.0)
    return sample
