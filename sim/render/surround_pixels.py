"""What the pixels of a photograph show of the surround: LLVM follows the rays of a piece of a row at once.

The panorama is filtered, so that one look-up serves all samples of a pixel.
"""

import warp as wp

from digs_warp.device.kernel_options import group_module_options
from digs_warp.sim.render.ground_light import has_sharp_shadows, may_be_shaded, soft_floor_share
from digs_warp.sim.render.lighting import Light, panorama_at, panorama_uv
from digs_warp.sim.render.surface import Surface, passes_by
from digs_warp.sim.render.surround import (
    Boundary,
    boundary_distance,
    is_on_floor,
    panorama_direction,
    panorama_zoom,
    unit,
)
from digs_warp.sim.render.view import Encoding, Track, View, ray_direction_cam, srgb_byte

wp.set_module_options(group_module_options())

# From the center of a pixel to its corner [px], rounded up.
HALF_DIAGONAL = wp.constant(0.75)

# Upper limit of a sample, as a multiple of full white.
SAMPLE_LIMIT = wp.constant(4.0)

# What a pixel shows: the surround alone, the same perhaps in a sharp shadow, or what one ray met, be it
# nothing. Where it is NOTHING, more rays would see the same.
NOTHING, SHADED, MISSED, FURNITURE, OBJECT = (wp.constant(wp.uint8(kind)) for kind in range(5))


@wp.struct
class Image:
    """What is rendered."""

    numbers: wp.array[int]  # of the pixels
    bytes: wp.array2d[wp.uint8]  # [pixels, 3]
    light: wp.array2d[float]  # [pixels, 3]
    mask: wp.array[wp.uint8]
    kinds: wp.array[wp.uint8]
    rough: wp.array[wp.uint8]
    around: wp.array[wp.vec3]  # the surround behind what is not NOTHING


@wp.func
def write(image: Image, encoding: Encoding, pixel: int, light: wp.vec3, covered: float):
    """Set a pixel."""
    for channel in range(3):
        image.bytes[pixel, channel] = srgb_byte(encoding, light[channel])
        image.light[pixel, channel] = light[channel]
    image.mask[pixel] = wp.uint8(255.0 * covered + 0.5)


# Pixels of a piece.
PIECE = wp.constant(32)

# Where its fields begin in memory: position in the panorama, the angle there that a small angle of the ray
# covers, distance to the surround [m], place on the floor [m], whether it is the floor, whether no ray meets
# the scene (2: but a sharp shadow may lie there), the share of the floor's light that arrives, and the sum
# over the exposure.
U, V, ZOOM, ROOM, X, Y = (wp.constant(PIECE * field) for field in range(6))
IS_FLOOR, IS_EMPTY, ARRIVING, SUM = (wp.constant(PIECE * field) for field in (6, 7, 8, 11))
MEMORY = PIECE * 14


@wp.func
def look_around(
    boundary: Boundary, center: wp.vec3, toward: wp.vec3, state: wp.array[float], i: int
):
    """Follow a ray to where it meets the surround; for pixel ``i`` of a piece."""
    room = boundary_distance(boundary, center, toward)
    point = center + room * toward
    uv = panorama_uv(panorama_direction(boundary, point))
    state[U + i] = uv[0]
    state[V + i] = uv[1]
    state[ZOOM + i] = panorama_zoom(boundary, point, toward, room)
    state[ROOM + i] = room
    state[X + i] = point[0]
    state[Y + i] = point[1]
    state[IS_FLOOR + i] = wp.where(is_on_floor(boundary, point), 1.0, 0.0)


@wp.func
def add_seen(track: Track, light: Light, size: int, share: float, state: wp.array[float]):
    """Add a share of the panorama where the rays end."""
    for m in range(size):
        # The level of the pyramid whose texels are as wide as the pixel.
        texels = track.texels * state[ZOOM + m]
        level = wp.float32(0.0)
        if texels > 1.0:
            level = wp.log2(texels)
        seen = panorama_at(light.panorama, wp.vec2(state[U + m], state[V + m]), level)
        seen = share * wp.min(seen, wp.vec3(SAMPLE_LIMIT))
        for channel in range(3):
            state[SUM + channel * PIECE + m] += seen[channel]


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
    """Find the surround in a piece of a row, over the exposure; most pixels show nothing else."""
    piece = first + wp.tid()
    along = (view.width + PIECE - 1) // PIECE
    row = piece // along
    left = (piece % along) * PIECE
    size = wp.min(PIECE, view.width - left)
    y = float(row) + 0.5
    band = track.bands[row]
    center = track.middle_centers[band]
    rotation = track.middle_rotations[band]
    swing = track.swings[band]
    shift = track.shifts[band]
    boundary = view.boundary
    spread = HALF_DIAGONAL * view.pixel_angle + swing
    reach = surface.radius + shift
    memory = wp.zeros(shape=(wp.static(MEMORY),), dtype=float)
    # A view: LLVM reloads the address of the local array itself after every write.
    state = wp.array(ptr=memory.ptr, shape=(wp.static(MEMORY),), dtype=float)
    for i in range(PIECE):
        toward = unit(rotation * ray_direction_cam(view, float(left + i) + 0.5, y))
        look_around(boundary, center, toward, state, i)
        state[IS_EMPTY + i] = wp.where(passes_by(reach, center, toward, spread), 1.0, 0.0)
    floor = surface.floor
    is_sharp = has_sharp_shadows(floor)
    too_long = wp.int32(0)
    for n in range(size):
        arrives = wp.vec3(1.0)
        if state[IS_FLOOR + n] > 0.0:
            if is_sharp and state[IS_EMPTY + n] > 0.0:
                # A slanted pixel covers more of the floor.
                slope = wp.max((center[2] - boundary.floor) / state[ROOM + n], 0.02)
                point = wp.vec3(state[X + n], state[Y + n], boundary.floor)
                if may_be_shaded(surface, light, point, spread * state[ROOM + n] / slope):
                    state[IS_EMPTY + n] = 2.0
            elif floor.exists == 1 and not is_sharp:
                arrives = soft_floor_share(floor, state[X + n], state[Y + n])
        for color in range(3):
            state[ARRIVING + color * PIECE + n] = arrives[color]
        # Over half a texel, what a pixel shows is linear: its mean is the value in the middle.
        way = 2.0 * (swing + shift / state[ROOM + n])
        if way * wp.min(2.0 * track.texels * state[ZOOM + n], 1.0) > view.pixel_angle:
            too_long += 1
    if too_long > 0:
        for moment in range(track.moments):
            start = track.centers[band, moment]
            turned = track.rotations[band, moment]
            for j in range(PIECE):
                ray = turned * ray_direction_cam(view, float(left + j) + 0.5, y)
                look_around(boundary, start, ray, state, j)
            add_seen(track, light, size, 1.0 / float(track.moments), state)
    else:
        add_seen(track, light, size, 1.0, state)
    for out in range(size):
        number = row * view.width + left + out
        seen = wp.vec3(0.0)
        for channel in range(3):
            at = channel * PIECE + out
            seen[channel] = state[SUM + at] * state[ARRIVING + at]
        kind = MISSED
        if state[IS_EMPTY + out] > 0.0:
            kind = wp.where(state[IS_EMPTY + out] > 1.0, SHADED, NOTHING)
        image.kinds[number] = kind
        image.around[number] = seen
        if kind == NOTHING:
            write(image, encoding, number, seen, 0.0)
