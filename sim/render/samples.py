"""Samples of a photograph: a ray followed through the scene, and what it shows of the surround."""

import warp as wp

from digs_warp.sim.render.ground_light import has_sharp_shadows, soft_floor_share
from digs_warp.sim.render.hit_material import look_at_hit
from digs_warp.sim.render.lighting import Light, sample_panorama
from digs_warp.sim.render.shading import coat, shade
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
    is_on_floor,
    panorama_direction,
    panorama_zoom,
)
from digs_warp.sim.render.view import FAR, View

# Upper limit of a sample, as a multiple of full white.
SAMPLE_LIMIT = wp.constant(4.0)

# A ray that carries less than this share of the light ends.
FAINT = wp.constant(0.004)


@wp.func
def seen_surround(
    view: View,
    surface: Surface,
    light: Light,
    center: wp.vec3,
    direction: wp.vec3,
    distance: float,
    level: float,
    passing: wp.vec3,
) -> wp.vec3:
    """The panorama where a ray from the camera meets the surround, times the weight of its samples.

    It is as bright as the objects leave the floor, but for sharp shadows, which are in the weight.
    ``distance`` to the surround [m]; ``level``: of the pyramid, that fits a pixel of a camera in the
    panorama's place.
    """
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
def scene_sample(view: View, surface: Surface, light: Light, direction: wp.vec3) -> Sample:
    """Follow a ray straight on through transparent walls, front to back, to the first that is opaque."""
    sample = Sample()
    sample.passing = wp.vec3(1.0)
    start = wp.float32(0.0)
    for _layer in range(MAX_LAYERS):
        hit = wp.mesh_query_ray(surface.mesh, view.center + start * direction, direction, FAR)
        if not hit.result:
            break
        distance = start + hit.t
        width = distance * view.pixel_cone
        opacity = wp.float32(1.0)
        transmission = wp.float32(0.0)
        if is_see_through(surface, hit):
            texture = texture_level(surface, hit, direction, width)
            opacity = opacity_at(surface, hit, texture)
            transmission = transmission_at(surface, hit, texture)
        if opacity > 0.0:
            look = look_at_hit(surface, hit, direction, width)
            point = view.center + distance * direction
            shine = coat(look, direction)
            seen = shade(
                view, surface, light, hit, look, point, direction, distance, shine, transmission
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
        start = distance + surface.step
    return sample
