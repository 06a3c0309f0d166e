"""The ray-casting kernels: one Warp thread per pixel, rays through a BVH, refraction in bodies of glass.

A thread writes only its own pixel and draws its random numbers from (seed, pixel), so images do not depend on
the number of threads.
"""

import warp as wp

from digs_warp.device.kernel_options import ray_module_options
from digs_warp.sim.render.ground_light import (
    has_sharp_shadows,
    may_be_shaded,
    sharp_floor_share,
    soft_floor_share,
)
from digs_warp.sim.render.hit_material import look_at_hit
from digs_warp.sim.render.lighting import Light, sample_panorama
from digs_warp.sim.render.shading import coat, coat_at, shade
from digs_warp.sim.render.surface import (
    MAX_LAYERS,
    Surface,
    is_see_through,
    opacity_at,
    passes_by,
    texture_level,
    transmission_at,
)
from digs_warp.sim.render.surround import (
    SPHERE,
    is_on_floor,
    panorama_direction,
    panorama_zoom,
)
from digs_warp.sim.render.view import (
    FAR,
    Encoding,
    Track,
    View,
    ray_direction_cam,
    srgb_byte,
    surround_distance,
    view_at,
)

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false


wp.set_module_options(ray_module_options())

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


# The golden ratio spreads the samples of a pixel evenly for any number of them.
GOLDEN = wp.constant(0.6180339887498949)

# Upper limit of a sample, as a multiple of full white.
SAMPLE_LIMIT = wp.constant(4.0)

# From the center of a pixel to its corner [px], rounded up.
HALF_DIAGONAL = wp.constant(0.75)

# A ray that carries less than this share of the light ends.
FAINT = wp.constant(0.004)


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
    distance = surround_distance(view, center, direction)
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


@wp.func
def way_to_surround(view: View, center: wp.vec3, direction: wp.vec3) -> float:
    """Distance [m] to what a pixel shows of the surround; of a sphere, at least."""
    if view.boundary.shape == SPHERE:
        return view.boundary.radius - wp.length(center)
    return surround_distance(view, center, direction)


@wp.func
def is_floor_shaded(
    view: View, surface: Surface, light: Light, center: wp.vec3, direction: wp.vec3, spread: float
) -> bool:
    """Whether what a pixel shows of the floor may be in a sharp shadow."""
    if not has_sharp_shadows(surface.floor):
        return False
    distance = surround_distance(view, center, direction)
    point = center + distance * direction
    # A slanted pixel covers more of the floor, and its edge may reach it where its middle does not.
    slope = wp.max(-direction[2], 0.02)
    return may_be_shaded(surface, light, point, spread * distance / slope)


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


@wp.struct
class Pixel:
    """What is known of a pixel before a ray is cast."""

    number: int
    band: int  # of the track
    toward_cam: wp.vec3  # unit direction through its middle, in camera axes
    toward: wp.vec3  # the same in the middle of the exposure, in the world
    center: wp.vec3  # of the camera then
    is_empty: bool  # no ray through it meets the scene
    is_shaded: bool  # what it shows of the floor may be in a sharp shadow
    is_short: bool  # over the exposure, what it shows of the surround is linear


@wp.func
def pixel_of(view: View, track: Track, surface: Surface, light: Light, number: int) -> Pixel:
    """Look at where a pixel lies."""
    pixel = Pixel()
    pixel.number = number
    row = number // view.width
    band = track.bands[row]
    pixel.band = band
    column = float(number % view.width)
    pixel.toward_cam = ray_direction_cam(view, column + 0.5, float(row) + 0.5)
    toward = wp.normalize(track.middle_rotations[band] * pixel.toward_cam)
    center = track.middle_centers[band]
    pixel.toward = toward
    pixel.center = center
    spread = HALF_DIAGONAL * view.pixel_angle + track.swings[band]
    pixel.is_empty = passes_by(surface.radius + track.shifts[band], center, toward, spread)
    pixel.is_shaded = is_floor_shaded(view, surface, light, center, toward, spread)
    room = way_to_surround(view, center, toward)
    pixel.is_short = 2.0 * (track.swings[band] + track.shifts[band] / room) <= track.step
    return pixel


@wp.func
def surround_in(
    view: View, track: Track, surface: Surface, light: Light, pixel: Pixel, passing: wp.vec3
) -> wp.vec3:
    """The surround in a pixel, over the exposure; see `seen_surround`."""
    level = track.level
    # Over a short path it has its mean value in the middle.
    if pixel.is_short:
        return seen_surround(view, surface, light, pixel.center, pixel.toward, level, passing)
    total = wp.vec3(0.0)
    for moment in range(track.moments):
        toward = track.rotations[pixel.band, moment] * pixel.toward_cam
        start = track.centers[pixel.band, moment]
        total += seen_surround(view, surface, light, start, toward, level, passing)
    return total / float(track.moments)


# What one ray through a pixel met. Where it is nothing, more rays would see the same.
NOTHING = wp.constant(wp.uint8(0))
SHADED = wp.constant(wp.uint8(1))
FURNITURE = wp.constant(wp.uint8(2))
OBJECT = wp.constant(wp.uint8(3))


@wp.struct
class Image:
    """What is rendered."""

    numbers: wp.array[int]  # of the pixels
    bytes: wp.array2d[wp.uint8]  # [pixels, 3] sRGB
    light: wp.array2d[float]  # [pixels, 3] the same, linear and not clipped
    mask: wp.array[wp.uint8]  # [pixels] coverage 0..255
    rough: wp.array[wp.uint8]  # [numbers] 1: one sample is not enough
    kinds: wp.array[wp.uint8]  # [pixels] NOTHING to OBJECT; SHADED, too, before a ray is cast


@wp.func
def write(image: Image, encoding: Encoding, pixel: int, light: wp.vec3, covered: float):
    """Set a pixel."""
    for channel in range(3):
        image.bytes[pixel, channel] = srgb_byte(encoding, light[channel])
        image.light[pixel, channel] = light[channel]
    image.mask[pixel] = wp.uint8(255.0 * covered + 0.5)


@wp.kernel
def surround_kernel(
    first: int,
    view: View,
    track: Track,
    surface: Surface,
    light: Light,
    encoding: Encoding,
    # outputs
    image: Image,
):
    """Render the pixels that show only the surround, most of the image; a kernel without rays is fast."""
    number = first + wp.tid()
    pixel = pixel_of(view, track, surface, light, number)
    if not pixel.is_empty or pixel.is_shaded:
        image.kinds[number] = SHADED
        return
    seen = surround_in(view, track, surface, light, pixel, wp.vec3(1.0))
    write(image, encoding, number, seen, 0.0)
    image.kinds[number] = NOTHING


@wp.func
def followed(
    view: View,
    surface: Surface,
    light: Light,
    pixel: Pixel,
    direction: wp.vec3,
    surround_level: float,
    sample_number: int,
) -> Sample:
    """Follow a ray from the camera."""
    sample = Sample()
    if pixel.is_empty:
        sample.passing = wp.vec3(1.0)
    elif surface.see_through == 0:
        sample = solid_sample(view, surface, light, direction)
    else:
        sample = layered_sample(view, surface, light, direction, surround_level)
    # A single glint of the sun must not dominate its pixel.
    sample.color = wp.min(sample.color, wp.vec3(SAMPLE_LIMIT))
    if pixel.is_shaded and wp.max(sample.passing) > 0.0:
        end = view.center + surround_distance(view, view.center, direction) * direction
        if is_on_floor(view.boundary, end):
            arrives = sharp_floor_share(surface, light, end, sample_number)
            sample.passing = wp.cw_mul(sample.passing, arrives)
    return sample


@wp.func
def place_in_pixel(number: int, count: int, mirrored: int) -> wp.vec2:
    """Where a sample of ``count`` lies in its pixel, from 0 to 1: a lattice, symmetric around the middle.

    Where what the pixel shows is linear, the mean of the samples is exact. The lowest bits of ``mirrored``
    choose one of four such lattices.
    """
    x = (float(number) + 0.5) / float(count)
    y = GOLDEN * (float(number) - 0.5 * float(count - 1)) + 0.5
    y -= wp.floor(y)
    if (mirrored & 1) == 1:
        y = 1.0 - y
    return wp.where((mirrored & 2) == 2, wp.vec2(y, x), wp.vec2(x, y))


@wp.kernel
def color_kernel(
    first: int,
    view: View,
    track: Track,
    surface: Surface,
    light: Light,
    encoding: Encoding,
    samples: int,  # per moment; 0: one, in the middle of pixel and exposure
    seed: int,
    # outputs
    image: Image,
):
    """Average the samples of a pixel: image (box filter over pixel and exposure) and object coverage.

    The sensor integrates light over the exposure and clips the result; what it clips is in ``image.light``.
    """
    number = image.numbers[first + wp.tid()]
    pixel = pixel_of(view, track, surface, light, number)
    row = number // view.width
    total = Sample()
    if samples == 0:
        eye = view_at(view, track, row, 0)
        eye.center = pixel.center
        total = followed(eye, surface, light, pixel, pixel.toward, track.level, 0)
        kind = wp.where(total.covered > 0.0, OBJECT, FURNITURE)
        if wp.min(total.passing) >= 1.0 or pixel.is_empty:
            kind = wp.where(pixel.is_shaded, SHADED, NOTHING)
        image.kinds[number] = kind
    else:
        # The same even pattern in every pixel, mirrored at random: no moire, little noise.
        mirrored = wp.randi(wp.rand_init(seed, number))
        for moment in range(track.moments):
            eye = view_at(view, track, row, moment)
            for s in range(samples):
                # Together they cover the pixel evenly, and each pair of a moment lies around the middle.
                i = (s // 2) * track.moments + moment
                i = wp.where(s % 2 == 1, samples * track.moments - 1 - i, i)
                if samples == 1:  # neighbors in the pixel are apart in time
                    i = (moment * wp.where(track.moments % 5 == 0, 7, 5)) % track.moments
                place = place_in_pixel(i, samples * track.moments, mirrored)
                x = float(number % view.width) + place[0]
                y = float(row) + place[1]
                direction = eye.world_from_cam * ray_direction_cam(eye, x, y)
                sample = followed(eye, surface, light, pixel, direction, track.level, i)
                total.color += sample.color
                total.passing += sample.passing
                total.covered += sample.covered
    share = 1.0 / float(wp.max(samples * track.moments, 1))
    mean = share * total.color
    # The panorama is filtered: one look-up serves all samples.
    if wp.max(total.passing) > 0.0:
        passing = share * total.passing
        mean += surround_in(view, track, surface, light, pixel, passing)
    write(image, encoding, number, mean, share * total.covered)


# A pixel is smooth if the mean of two neighbors, on opposite sides, differs from it by less [byte steps].
# Below that, one sample is as near to the mean over the pixel as four are.
ROUGH = wp.constant(16)


@wp.func
def is_alike(one: wp.uint8, other: wp.uint8) -> bool:
    """Whether neighbors show the same sort of thing."""
    return wp.max(one, SHADED) == wp.max(other, SHADED)


@wp.kernel
def roughness_kernel(
    first: int,
    width: int,
    height: int,
    reach: int,  # [px] that what a pixel shows moves at most, from the middle of the exposure
    image: Image,  # of one sample for each pixel
):
    """Find the pixels that show edges or fine detail, and those beside an edge."""
    index = first + wp.tid()
    number = image.numbers[index]
    column = number % width
    row = number // width
    kind = image.kinds[number]
    found = wp.bool(False)
    for k in range(8):
        # Right, below right, below, below left; and the same farther away.
        step = wp.where(k < 4, 1, reach)
        x = wp.where(k % 4 < 2, step, (2 - k % 4) * step)
        y = wp.min(k % 4, 1) * step
        ahead = wp.min(row + y, height - 1) * width + wp.clamp(column + x, 0, width - 1)
        behind = wp.max(row - y, 0) * width + wp.clamp(column - x, 0, width - 1)
        if not is_alike(image.kinds[ahead], kind) or not is_alike(image.kinds[behind], kind):
            found = True
        if k < 4 and kind != NOTHING:
            for c in range(3):
                around = int(image.bytes[ahead, c]) + int(image.bytes[behind, c])
                if wp.abs(around - 2 * int(image.bytes[number, c])) > 2 * ROUGH:
                    found = True
    image.rough[index] = wp.uint8(wp.where(found, 1, 0))
