"""Light from the environment, for kernels: the panorama's pyramid, diffuse light and blurred specular light.

Diffuse light is the nine-coefficient irradiance of Ramamoorthi and Hanrahan, "An Efficient Representation for
Irradiance Environment Maps" (2001). Specular light is the first half of Karis' split sum ("Real Shading in
Unreal Engine 4", 2013): copies of the panorama, blurred with the GGX lobe of a few roughnesses, looked up
along the reflected ray.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

import numpy as np
import warp as wp

from digs_warp.sim.render.key_lights import KeyLights

wp.set_module_options({"enable_backward": False})

# The blurred copies hold roughness 0.2, 0.4 ... 1; between 0 and 0.2 the sharp panorama mixes in.
SPECULAR_COPIES = 5
SPECULAR_WIDTH = 128
SPECULAR_HEIGHT = 64

TWO_PI = wp.constant(2.0 * np.pi)
PI = wp.constant(np.pi)


@wp.struct
class Panorama:
    """The pyramid of an equirectangular image; level 0 is the finest."""

    texels: wp.array[wp.vec3]  # all levels, one after another
    offsets: wp.array[int]  # [levels] first texel of a level
    sizes: wp.array[wp.vec2i]  # [levels] width, height
    levels: int


@wp.struct
class Light:
    """Everything that shading needs from the environment (radiance times exposure)."""

    panorama: Panorama
    irradiance: wp.array[wp.vec3]  # [9] spherical harmonics of E(n) / pi, without the spots
    keys: KeyLights
    specular: wp.array3d[wp.vec3]  # [SPECULAR_COPIES, SPECULAR_HEIGHT, SPECULAR_WIDTH]
    rest: wp.array3d[wp.vec3]  # the same without the spots
    mirror_level: float


@wp.func
def panorama_uv(direction: wp.vec3) -> wp.vec2:
    """Position in the panorama, both in 0..1, of a unit direction; see sim.panorama."""
    u = 0.5 - wp.atan2(direction[1], direction[0]) / TWO_PI
    return wp.vec2(u, wp.acos(wp.clamp(direction[2], -1.0, 1.0)) / PI)


@wp.func
def sample_panorama_level(panorama: Panorama, level: int, uv: wp.vec2) -> wp.vec3:
    """Bilinear value of one level: wraps around sideways, stops at the poles."""
    width = panorama.sizes[level][0]
    height = panorama.sizes[level][1]
    x = uv[0] * float(width) - 0.5
    y = uv[1] * float(height) - 0.5
    left = int(wp.floor(x))
    top = int(wp.floor(y))
    fx = x - float(left)
    fy = y - float(top)
    x0 = (left + width) % width
    x1 = (left + 1 + width) % width
    first = panorama.offsets[level]
    row0 = first + wp.clamp(top, 0, height - 1) * width
    row1 = first + wp.clamp(top + 1, 0, height - 1) * width
    above = wp.lerp(panorama.texels[row0 + x0], panorama.texels[row0 + x1], fx)
    below = wp.lerp(panorama.texels[row1 + x0], panorama.texels[row1 + x1], fx)
    return wp.lerp(above, below, fy)


@wp.func
def sample_panorama(panorama: Panorama, direction: wp.vec3, level: float) -> wp.vec3:
    """Trilinear value of the panorama along a unit direction; level 0 is the finest."""
    uv = panorama_uv(direction)
    level = wp.clamp(level, 0.0, float(panorama.levels - 1))
    fine = int(wp.floor(level))
    blend = level - float(fine)
    color = sample_panorama_level(panorama, fine, uv)
    if blend > 0.0:
        color = wp.lerp(color, sample_panorama_level(panorama, fine + 1, uv), blend)
    return color


@wp.func
def diffuse_light(light: Light, n: wp.vec3) -> wp.vec3:
    """Irradiance over pi at unit normal n: the radiance that a white matte surface reflects."""
    # Basis order and signs as in digs_warp.geometry.sh, band by band.
    e = 0.28209479177387814 * light.irradiance[0]
    e += 0.4886025119029199 * (
        n[2] * light.irradiance[2] - n[1] * light.irradiance[1] - n[0] * light.irradiance[3]
    )
    e += 1.0925484305920792 * (
        n[0] * n[1] * light.irradiance[4]
        - n[1] * n[2] * light.irradiance[5]
        - n[0] * n[2] * light.irradiance[7]
    )
    e += (0.31539156525252005 * (3.0 * n[2] * n[2] - 1.0)) * light.irradiance[6]
    e += (0.5462742152960396 * (n[0] * n[0] - n[1] * n[1])) * light.irradiance[8]
    # Nine coefficients ring below zero opposite a strong light.
    return wp.vec3(wp.max(e[0], 0.0), wp.max(e[1], 0.0), wp.max(e[2], 0.0))


@wp.func
def sample_specular_copy(specular: wp.array3d[wp.vec3], copy: int, uv: wp.vec2) -> wp.vec3:
    """Bilinear value of one blurred copy."""
    x = uv[0] * float(SPECULAR_WIDTH) - 0.5
    y = uv[1] * float(SPECULAR_HEIGHT) - 0.5
    left = int(wp.floor(x))
    top = int(wp.floor(y))
    x0 = (left + SPECULAR_WIDTH) % SPECULAR_WIDTH
    x1 = (left + 1) % SPECULAR_WIDTH
    y0 = wp.clamp(top, 0, SPECULAR_HEIGHT - 1)
    y1 = wp.clamp(top + 1, 0, SPECULAR_HEIGHT - 1)
    above = wp.lerp(specular[copy, y0, x0], specular[copy, y0, x1], x - float(left))
    below = wp.lerp(specular[copy, y1, x0], specular[copy, y1, x1], x - float(left))
    return wp.lerp(above, below, y - float(top))


@wp.func
def copies_light(specular: wp.array3d[wp.vec3], copy: int, along: float, uv: wp.vec2) -> wp.vec3:
    """A value between a blurred copy and the next one; that of the first one for ``along`` below 0."""
    smooth = sample_specular_copy(specular, copy, uv)
    if along <= 0.0:
        return smooth
    return wp.lerp(smooth, sample_specular_copy(specular, copy + 1, uv), along)


@wp.func
def luminance(color: wp.vec3) -> float:
    """Weights of Rec. 709."""
    return 0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2]


@wp.func
def specular_light(light: Light, reflected: wp.vec3, roughness: float, spots: float) -> wp.vec3:
    """Light around the reflected ray, averaged over the lobe of ``roughness``; ``spots``: their share."""
    position = wp.clamp(roughness, 0.0, 1.0) * float(SPECULAR_COPIES) - 1.0
    uv = panorama_uv(reflected)
    copy = wp.clamp(int(wp.floor(position)), 0, SPECULAR_COPIES - 2)
    along = position - float(copy)  # below 0: between the sharp panorama and the first copy
    light_here = copies_light(light.specular, copy, along, uv)
    if spots < 1.0:
        rest = copies_light(light.rest, copy, along, uv)
        light_here = wp.lerp(wp.min(rest, light_here), light_here, spots)
    if along < 0.0:
        sharp = sample_panorama(light.panorama, reflected, light.mirror_level)
        if spots < 1.0:
            dimmed = wp.min(light.keys.level / wp.max(luminance(sharp), 1.0e-9), 1.0)
            sharp = wp.lerp(dimmed, 1.0, spots) * sharp
        light_here = wp.lerp(sharp, light_here, along + 1.0)
    return light_here
