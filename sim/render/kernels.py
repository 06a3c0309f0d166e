"""The ray-casting kernels: one Warp thread per pixel, rays through a BVH.

A thread writes only its own pixel and draws its random numbers from (seed, pixel), so images do not depend on
the number of threads.
"""

import warp as wp

from digs_warp.sim.render.lighting import Light, Panorama, sample_panorama
from digs_warp.sim.render.look import look_at_hit
from digs_warp.sim.render.shading import coat, key_visibility, shade
from digs_warp.sim.render.surface import (
    ANY_SURFACE,
    MAX_LAYERS,
    Surface,
    is_see_through,
    opacity_at,
    passes_by,
    texture_level,
    trace,
    transmission_at,
    viewer_side_normal,
)
from digs_warp.sim.render.view import (
    FAR,
    Track,
    View,
    ray_direction_cam,
    surround_distance,
    view_at,
)

wp.set_module_options({"enable_backward": False})

# The R2 sequence (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018) covers the pixel
# evenly with any number of samples.
R2_X = wp.constant(0.7548776662466927)
R2_Y = wp.constant(0.5698402909980532)

GOLDEN_RATIO = wp.constant(0.6180339887498949)

# Upper limit of a sample, as a multiple of full white.
SAMPLE_LIMIT = wp.constant(4.0)

# From the center of a pixel to its corner [px], rounded up.
HALF_DIAGONAL = wp.constant(0.75)

# A ray that carries less than this share of the light ends.
FAINT = wp.constant(0.004)


@wp.func
def srgb_byte(linear: float) -> wp.uint8:
    """Clip and encode a linear value as an sRGB byte."""
    value = wp.clamp(linear, 0.0, 1.0)
    if value <= 0.0031308:
        value = 12.92 * value
    else:
        value = 1.055 * wp.pow(value, 1.0 / 2.4) - 0.055
    return wp.uint8(value * 255.0 + 0.5)


@wp.func
def surround_place(view: View, center: wp.vec3, direction: wp.vec3) -> wp.vec3:
    """Unit vector from the origin to the point where a ray from the camera meets the surround."""
    return (center + surround_distance(view, center, direction) * direction) / view.surround_radius


@wp.func
def seen_surround(panorama: Panorama, place: wp.vec3, level: float, passing: wp.vec3) -> wp.vec3:
    """The panorama at a place, times the weight of the samples that reach it."""
    return wp.cw_mul(
        passing, wp.min(sample_panorama(panorama, place, level), wp.vec3(SAMPLE_LIMIT))
    )


@wp.struct
class Sample:
    """The result of one ray."""

    color: wp.vec3  # of the object
    passing: wp.vec3  # share of the surround's light that passes through
    covered: float  # 1: it met the object
    visible: float  # share of the bright spots seen from the hit on an opaque object


@wp.func
def solid_sample(
    view: View,
    surface: Surface,
    light: Light,
    direction: wp.vec3,
    pick: float,
    known_visible: float,
) -> Sample:
    """Follow a ray through an opaque scene.

    ``known_visible``: from a sample of the same pixel; negative: cast a shadow ray.
    """
    sample = Sample()
    sample.passing = wp.vec3(1.0)
    hit = wp.mesh_query_ray(surface.mesh, view.center, direction, FAR)
    if hit.result:
        sample.passing = wp.vec3(0.0)
        width = hit.t * view.pixel_cone
        look = look_at_hit(surface, hit, direction, width)
        point = view.center + hit.t * direction
        sample.visible = known_visible
        if known_visible < 0.0:
            sample.visible = key_visibility(surface, light, hit, look, point, pick)
        sample.color = shade(
            view, surface, light, look, point, direction, width, sample.visible, 0.0
        )
        sample.covered = 1.0
    return sample


@wp.func
def layered_sample(
    view: View, surface: Surface, light: Light, direction: wp.vec3, pick: float
) -> Sample:
    """Follow a ray straight on through transparent walls, front to back."""
    sample = Sample()
    sample.passing = wp.vec3(1.0)
    travelled = wp.float32(0.0)
    for _layer in range(MAX_LAYERS):
        origin = view.center + travelled * direction
        hit = wp.mesh_query_ray(surface.mesh, origin, direction, FAR)
        if not hit.result:
            break
        distance = travelled + hit.t
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
            visible = key_visibility(surface, light, hit, look, point, pick)
            seen = shade(view, surface, light, look, point, direction, width, visible, transmission)
            sample.color = sample.color + opacity * wp.cw_mul(sample.passing, seen)
            body = transmission * (1.0 - look.metallic) * look.color
            clear = wp.cw_mul(body, wp.vec3(1.0) - coat(look, direction))
            through = wp.vec3(1.0 - opacity) + opacity * clear
            sample.passing = wp.cw_mul(sample.passing, through)
            sample.covered = 1.0
        if wp.max(sample.passing) < FAINT:
            sample.passing = wp.vec3(0.0)
            break
        travelled = distance + surface.step
    return sample


@wp.kernel
def color_kernel(
    first: int,
    view: View,
    track: Track,
    surface: Surface,
    light: Light,
    surround_level: float,  # pyramid level of the panorama that fits a pixel
    surround_step: float,  # [rad] between the texels of that level
    samples: int,  # per moment
    seed: int,
    # outputs
    image: wp.array2d[wp.uint8],  # [pixels, 3] sRGB
    mask: wp.array[wp.uint8],  # [pixels] coverage 0..255
):
    """Average the samples of a pixel: image (box filter over pixel and exposure) and object coverage.

    The sensor integrates light over the exposure and clips the result.
    """
    pixel = first + wp.tid()
    state = wp.rand_init(seed, pixel)
    # The same even pattern in every pixel, with a random shift: no moire, little noise.
    shift_x = wp.randf(state)
    shift_y = wp.randf(state)
    shift_pick = wp.randf(state)
    column = float(pixel % view.width)
    row = float(pixel // view.width)
    total = wp.vec3(0.0)
    covered = wp.float32(0.0)
    visible = wp.float32(-1.0)
    band = track.bands[pixel // view.width]
    middle_cam = ray_direction_cam(view, column + 0.5, row + 0.5)
    middle = wp.normalize(track.middle_rotations[band] * middle_cam)
    middle_center = track.middle_centers[band]
    spread = HALF_DIAGONAL * view.pixel_cone * wp.sqrt(float(samples)) + track.swings[band]
    is_empty = passes_by(surface.radius + track.shifts[band], middle_center, middle, spread)
    # Between two texels the panorama is linear: a short path has its mean value in the middle.
    room = view.surround_radius - wp.length(middle_center)
    is_short = 2.0 * (track.swings[band] + track.shifts[band] / room) <= surround_step
    open_way = wp.vec3(0.0)
    for moment in range(track.moments):
        passing = wp.vec3(float(samples))
        if not is_empty:
            passing = wp.vec3(0.0)
            eye = view_at(view, track, pixel // view.width, moment)
            for s in range(samples):
                # One sequence over all moments: together they cover the pixel evenly.
                i = float(moment * samples + s)
                dx = shift_x + R2_X * i
                dy = shift_y + R2_Y * i
                pick = shift_pick + GOLDEN_RATIO * i
                x = column + dx - wp.floor(dx)
                y = row + dy - wp.floor(dy)
                direction = eye.world_from_cam * ray_direction_cam(eye, x, y)
                pick = pick - wp.floor(pick)
                sample = Sample()
                if surface.see_through == 0:
                    sample = solid_sample(eye, surface, light, direction, pick, visible)
                    # Two samples share a shadow ray, even across moments.
                    if sample.covered == 1.0:
                        visible = wp.where(visible < 0.0, sample.visible, -1.0)
                else:
                    sample = layered_sample(eye, surface, light, direction, pick)
                # A single glint of the sun must not dominate its pixel.
                total += wp.min(sample.color, wp.vec3(SAMPLE_LIMIT))
                passing += sample.passing
                covered += sample.covered
        open_way += passing
        # The panorama is filtered: one look-up serves all samples of a moment.
        if not is_short and wp.max(passing) > 0.0:
            toward = track.rotations[band, moment] * middle_cam
            place = surround_place(view, track.centers[band, moment], toward)
            total += seen_surround(light.panorama, place, surround_level, passing)
    if is_short and wp.max(open_way) > 0.0:
        place = surround_place(view, middle_center, middle)
        total += seen_surround(light.panorama, place, surround_level, open_way)
    count = float(samples * track.moments)
    mean = total / count
    image[pixel, 0] = srgb_byte(mean[0])
    image[pixel, 1] = srgb_byte(mean[1])
    image[pixel, 2] = srgb_byte(mean[2])
    mask[pixel] = wp.uint8((255.0 * covered) / count + 0.5)


@wp.kernel
def geometry_kernel(
    first: int,
    view: View,
    surface: Surface,
    # outputs
    depth: wp.array[float],  # [pixels] planar z [m]
    normals: wp.array[wp.vec3],  # [pixels] world, toward the viewer
    materials: wp.array[int],  # [pixels] -1: surround
):
    """Cast one ray through the exact center of a pixel."""
    pixel = first + wp.tid()
    x = float(pixel % view.width) + 0.5
    y = float(pixel // view.width) + 0.5
    direction_cam = ray_direction_cam(view, x, y)
    direction = view.world_from_cam * direction_cam
    start = wp.float32(0.0)
    # With a reach of 0 the query ends at once.
    is_empty = passes_by(surface.radius, view.center, direction, 0.0)
    hit = wp.mesh_query_ray(surface.mesh, view.center, direction, wp.where(is_empty, 0.0, FAR))
    if hit.result and is_see_through(surface, hit):
        level = texture_level(surface, hit, direction, hit.t * view.pixel_cone)
        if opacity_at(surface, hit, level) == 0.0:
            # A hole: continue to the first solid surface.
            distance = trace(surface, view.center, direction, FAR, view.pixel_cone, ANY_SURFACE)
            start = wp.where(distance < 0.0, FAR, distance - 0.5 * surface.step)
            hit = wp.mesh_query_ray(surface.mesh, view.center + start * direction, direction, FAR)
    if hit.result:
        depth[pixel] = (start + hit.t) * direction_cam[2]
        normals[pixel] = viewer_side_normal(surface, hit, direction)
        materials[pixel] = surface.materials[hit.face]
    else:
        distance = surround_distance(view, view.center, direction)
        depth[pixel] = distance * direction_cam[2]
        normals[pixel] = -wp.normalize(view.center + distance * direction)
        materials[pixel] = -1
