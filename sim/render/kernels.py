"""The ray-casting kernels: one Warp thread per pixel averages samples over the pixel and the exposure.

A thread writes only its own pixel and draws its random numbers from (seed, pixel), so images do not depend on
the number of threads.
"""

import warp as wp

from digs_warp.device.kernel_options import ray_module_options
from digs_warp.sim.render.ground_light import has_sharp_shadows, may_be_shaded, sharp_floor_share
from digs_warp.sim.render.lighting import Light
from digs_warp.sim.render.samples import (
    SAMPLE_LIMIT,
    Sample,
    scene_sample,
    seen_surround,
)
from digs_warp.sim.render.surface import Surface, passes_by
from digs_warp.sim.render.surround import boundary_distance, is_on_floor
from digs_warp.sim.render.view import (
    Encoding,
    Track,
    View,
    center_ray,
    ray_direction_cam,
    srgb_byte,
    view_at,
)

wp.set_module_options(ray_module_options())

# The golden ratio spreads the samples of a pixel evenly for any number of them.
GOLDEN = wp.constant(0.6180339887498949)

# From the center of a pixel to its corner [px], rounded up.
HALF_DIAGONAL = wp.constant(0.75)


@wp.struct
class Pixel:
    """What is known of a pixel before a ray is cast."""

    number: int
    band: int  # of the track
    toward_cam: wp.vec3  # unit direction through its middle, in camera axes
    toward: wp.vec3  # the same in the middle of the exposure, in the world
    center: wp.vec3  # of the camera then
    room: float  # distance from there to the surround [m]
    is_empty: bool  # no ray through it meets the scene
    is_shaded: bool  # what it shows of the floor may be in a sharp shadow
    is_short: bool  # over the exposure, what it shows of the surround is linear


@wp.func
def is_floor_shaded(surface: Surface, light: Light, pixel: Pixel, spread: float) -> bool:
    """Whether what a pixel shows of the floor may be in a sharp shadow."""
    if not has_sharp_shadows(surface.floor):
        return False
    point = pixel.center + pixel.room * pixel.toward
    # A slanted pixel covers more of the floor, and its edge may reach it where its middle does not.
    slope = wp.max(-pixel.toward[2], 0.02)
    return may_be_shaded(surface, light, point, spread * pixel.room / slope)


@wp.func
def pixel_of(view: View, track: Track, surface: Surface, light: Light, number: int) -> Pixel:
    """Look at where a pixel lies."""
    pixel = Pixel()
    pixel.number = number
    row = number // view.width
    band = track.bands[row]
    pixel.band = band
    pixel.toward_cam = center_ray(view, number)
    toward = wp.normalize(track.middle_rotations[band] * pixel.toward_cam)
    center = track.middle_centers[band]
    pixel.toward = toward
    pixel.center = center
    spread = HALF_DIAGONAL * view.pixel_angle + track.swings[band]
    pixel.is_empty = passes_by(surface.radius + track.shifts[band], center, toward, spread)
    pixel.room = boundary_distance(view.boundary, center, toward)
    pixel.is_shaded = is_floor_shaded(surface, light, pixel, spread)
    pixel.is_short = 2.0 * (track.swings[band] + track.shifts[band] / pixel.room) <= track.step
    return pixel


@wp.func
def surround_in(
    view: View, track: Track, surface: Surface, light: Light, pixel: Pixel, passing: wp.vec3
) -> wp.vec3:
    """The surround in a pixel, over the exposure; see `seen_surround`."""
    level = track.level
    # Over a short path it has its mean value in the middle.
    if pixel.is_short:
        return seen_surround(
            view, surface, light, pixel.center, pixel.toward, pixel.room, level, passing
        )
    total = wp.vec3(0.0)
    for moment in range(track.moments):
        toward = track.rotations[pixel.band, moment] * pixel.toward_cam
        start = track.centers[pixel.band, moment]
        room = boundary_distance(view.boundary, start, toward)
        total += seen_surround(view, surface, light, start, toward, room, level, passing)
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
    number: int,
) -> Sample:
    """Follow a ray from the camera; ``number`` of the sample in its pixel."""
    sample = Sample()
    if pixel.is_empty:
        sample.passing = wp.vec3(1.0)
    else:
        sample = scene_sample(view, surface, light, direction)
    # A single glint of the sun must not dominate its pixel.
    sample.color = wp.min(sample.color, wp.vec3(SAMPLE_LIMIT))
    if pixel.is_shaded and wp.max(sample.passing) > 0.0:
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
    pixel = pixel_of(view, track, surface, light, number)
    row = number // view.width
    total = Sample()
    # The same even pattern in every pixel, mirrored at random: no moire, little noise.
    mirrored = wp.randi(wp.rand_init(seed, number))
    count = wp.max(samples * track.moments, 1)
    for n in range(count):
        eye = view_at(view, track, row, n // wp.max(samples, 1))
        direction = pixel.toward
        i = wp.int32(0)
        if samples == 0:
            eye.center = pixel.center
        else:
            i = sample_number(n, samples, track.moments)
            place = place_in_pixel(i, count, mirrored)
            x = float(number % view.width) + place[0]
            y = float(row) + place[1]
            direction = eye.world_from_cam * ray_direction_cam(eye, x, y)
        # A second call would leave the function, and copies of the scene for each call, out of line.
        sample = followed(eye, surface, light, pixel, direction, i)
        total.color += sample.color
        total.passing += sample.passing
        total.covered += sample.covered
    if samples == 0:
        kind = wp.where(total.covered > 0.0, OBJECT, FURNITURE)
        if wp.min(total.passing) >= 1.0 or pixel.is_empty:
            kind = wp.where(pixel.is_shaded, SHADED, NOTHING)
        image.kinds[number] = kind
    share = 1.0 / float(count)
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
