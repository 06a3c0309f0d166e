"""The ray-casting kernels: one Warp thread per pixel averages samples over the pixel and the exposure.

A thread writes only its own pixel and draws its random numbers from (seed, pixel), so images do not depend on
the number of threads.
"""

import warp as wp

from digs_warp.device.kernel_options import ray_module_options
from digs_warp.sim.render.ground_light import has_sharp_shadows, sharp_floor_share
from digs_warp.sim.render.hit_material import look_at_hit
from digs_warp.sim.render.lighting import Light
from digs_warp.sim.render.shading import coat, shade
from digs_warp.sim.render.surface import (
    MAX_LAYERS,
    Surface,
    is_see_through,
    opacity_at,
    texture_level,
    transmission_at,
)
from digs_warp.sim.render.surround import boundary_distance, is_on_floor, unit
from digs_warp.sim.render.surround_pixels import (
    FURNITURE,
    MISSED,
    NOTHING,
    OBJECT,
    SAMPLE_LIMIT,
    SHADED,
    Image,
    write,
)
from digs_warp.sim.render.view import FAR, Encoding, Track, View, ray_direction_cam, view_at

wp.set_module_options(ray_module_options())

# A ray that carries less than this share of the light ends.
FAINT = wp.constant(0.004)


@wp.struct
class Sample:
    """The result of one ray."""

    color: wp.vec3  # of the scene
    passing: wp.vec3  # share of the surround's light that passes through
    covered: float  # 1: it met an object


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
            if surface.objects[hit.face] > 0:  # not furniture
                sample.covered = 1.0
        if wp.max(sample.passing) < FAINT:
            sample.passing = wp.vec3(0.0)
            break
        start = distance + surface.step
    return sample


# The golden ratio spreads the samples of a pixel evenly for any number of them.
GOLDEN = wp.constant(0.6180339887498949)


@wp.func
def followed(
    view: View,
    surface: Surface,
    light: Light,
    kind: wp.uint8,
    direction: wp.vec3,
    number: int,
) -> Sample:
    """Follow a ray from the camera; ``kind`` of the pixel, ``number`` of the sample in it."""
    sample = Sample()
    if kind == SHADED:
        sample.passing = wp.vec3(1.0)
    else:
        sample = scene_sample(view, surface, light, direction)
    # A single glint of the sun must not dominate its pixel.
    sample.color = wp.min(sample.color, wp.vec3(SAMPLE_LIMIT))
    if has_sharp_shadows(surface.floor) and wp.max(sample.passing) > 0.0:
        end = view.center + boundary_distance(view.boundary, view.center, direction) * direction
        if is_on_floor(view.boundary, end):
            arrives = sharp_floor_share(surface, light, end, number)
            sample.passing = wp.cw_mul(sample.passing, arrives)
    return sample


@wp.func
def sample_number(n: int, samples: int, moments: int) -> int:
    """Place in the pattern of the n-th sample, of so many for each moment.

    Together they cover the pixel evenly, and each pair of a moment lies around the middle.
    """
    moment = n // samples
    s = n % samples
    if samples == 1:  # neighbors in the pixel are apart in time
        return (moment * wp.where(moments % 5 == 0, 7, 5)) % moments
    i = (s // 2) * moments + moment
    return wp.where(s % 2 == 1, samples * moments - 1 - i, i)


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
    kind = image.kinds[number]
    row = number // view.width
    band = track.bands[row]
    total = Sample()
    # The same even pattern in every pixel, mirrored at random: no moire, little noise.
    mirrored = wp.randi(wp.rand_init(seed, number))
    count = wp.max(samples * track.moments, 1)
    for n in range(count):
        eye = view_at(view, track, row, n // wp.max(samples, 1))
        i = wp.int32(0)
        place = wp.vec2(0.5, 0.5)
        if samples == 0:
            eye.center = track.middle_centers[band]
            eye.world_from_cam = track.middle_rotations[band]
        else:
            i = sample_number(n, samples, track.moments)
            place = place_in_pixel(i, count, mirrored)
        x = float(number % view.width) + place[0]
        direction = unit(eye.world_from_cam * ray_direction_cam(eye, x, float(row) + place[1]))
        # A second call would leave the function, and copies of the scene for each call, out of line.
        sample = followed(eye, surface, light, kind, direction, i)
        total.color += sample.color
        total.passing += sample.passing
        total.covered += sample.covered
    if samples == 0:
        met = wp.where(total.covered > 0.0, OBJECT, FURNITURE)
        if wp.min(total.passing) >= 1.0:
            met = wp.where(has_sharp_shadows(surface.floor), MISSED, NOTHING)
        image.kinds[number] = wp.where(kind == SHADED, SHADED, met)
    share = 1.0 / float(count)
    # The panorama is filtered: one look-up served all samples.
    mean = share * (total.color + wp.cw_mul(total.passing, image.around[number]))
    write(image, encoding, number, mean, share * total.covered)


# A pixel is smooth if the mean of two neighbors, on opposite sides, differs from it by less [byte steps].
# Four samples there and one elsewhere are within a tenth of the error of four everywhere.
ROUGH = wp.constant(16)


@wp.func
def is_alike(one: wp.uint8, other: wp.uint8) -> bool:
    """Whether neighbors show the same sort of thing."""
    return wp.max(one, MISSED) == wp.max(other, MISSED)


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
