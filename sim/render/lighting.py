"""Environment light for kernels: panorama pyramid, diffuse and specular light, bright spots (key lights).

Diffuse light is the nine-coefficient irradiance of Ramamoorthi and Hanrahan, "An Efficient Representation for
Irradiance Environment Maps" (2001). Specular light is the first half of Karis' split sum ("Real Shading in
Unreal Engine 4", 2013): copies of the panorama, blurred with the GGX lobe of a few roughnesses, looked up
along the reflected ray.
"""

import numpy as np
import warp as wp

from digs_warp.sim.scene.environment import panorama_directions, solid_angles

# A spot is brighter than this multiple of the mean radiance; only the excess is separated.
SPOT_LEVEL = 4.0

# Largest angular radius of a spot: wider ones have no sharp shadows.
SPOT_RADIUS_DEGREES = 18.0

# Largest number of spots, and their smallest share of all light.
MAX_SPOTS = 8
MIN_SHARE = 0.02

# Weights of red, green and blue (Rec. 709).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

# Points per spot for shadow rays, and those of them that lie farthest out, with one in the middle.
SPOT_POINTS = 64
RIM_POINTS = 7

# Steps of the grid along whose curve the points of a spot are chosen.
CURVE_STEPS = 1024


@wp.struct
class KeyLights:
    """The spots; a ``count`` of 0 costs nothing."""

    count: int
    vectors: wp.array[wp.vec3]  # [count] unit direction of the vector irradiance
    colors: wp.array[wp.vec3]  # [count] irradiance at normal incidence over pi, exposed
    strengths: wp.array[float]  # [count] luminance of the colors
    points: wp.array2d[wp.vec3]  # [count, SPOT_POINTS] unit directions of equal strength
    rims: wp.array2d[wp.vec3]  # [count, RIM_POINTS] those farthest out, and one in the middle
    level: float  # luminance above which radiance belongs to a spot


@wp.func
def key_light(keys: KeyLights, normal: wp.vec3) -> wp.vec3:
    """Irradiance over pi of all spots, without shadows."""
    light = wp.vec3(0.0)
    for k in range(keys.count):
        light += wp.max(wp.dot(normal, keys.vectors[k]), 0.0) * keys.colors[k]
    return light


def take_out_spots(radiance: np.ndarray) -> tuple[np.ndarray, KeyLights]:
    """Split an exposed panorama into its smooth part and its spots.

    Args:
        radiance: linear RGB, shape (height, width, 3), small (a few hundred pixels wide).

    Returns:
        The panorama without the spots, same shape, and the spots.
    """
    height, width = radiance.shape[:2]
    directions = panorama_directions(width, height)
    areas = np.broadcast_to(solid_angles(width, height), (height, width))
    level = radiance @ LUMINANCE
    threshold = SPOT_LEVEL * float((level * areas).sum() / (4 * np.pi))
    excess_share = np.where(level > threshold, 1 - threshold / np.maximum(level, 1e-30), 0.0)
    power = level * excess_share * areas
    smooth = radiance.astype(np.float64)
    spots = []
    everything = float((level * areas).sum())
    for _ in range(MAX_SPOTS):
        center = directions.reshape(-1, 3)[power.argmax()]
        inside = directions @ center > np.cos(np.radians(SPOT_RADIUS_DEGREES))
        inside &= power > 0
        if power[inside].sum() <= MIN_SHARE * everything:
            break
        taken = radiance * (excess_share * inside)[..., None]
        smooth -= taken
        flux = taken[inside] * areas[inside][:, None]
        spots.append(_spot(directions[inside], flux, np.pi / height))
        power = np.where(inside, 0.0, power)
    keys = _pack(spots)
    keys.level = threshold
    return np.maximum(smooth, 0.0).astype(np.float32), keys


def _spot(directions: np.ndarray, flux: np.ndarray, texel: float) -> tuple[np.ndarray, ...]:
    """Return vector (3,), color (3,), points (SPOT_POINTS, 3) and rim (RIM_POINTS, 3) of one spot.

    Args:
        directions: of its pixels, shape (n, 3).
        flux: radiance times solid angle of each, shape (n, 3).
        texel: height of a pixel [rad].
    """
    weight = flux @ LUMINANCE
    vector = weight @ directions
    # Less than the sum of the weights for wide spots: their parts have different directions.
    concentration = float(np.linalg.norm(vector) / weight.sum())
    vector = vector / np.linalg.norm(vector)
    color = flux.sum(axis=0) * concentration / np.pi
    axes = np.linalg.svd(vector[None])[2][1:]
    order = np.argsort(_place_on_curve(directions @ axes.T), kind="stable")
    shares = (np.arange(SPOT_POINTS) + 0.5) / SPOT_POINTS * weight.sum()
    chosen = order[np.searchsorted(np.cumsum(weight[order]), shares).clip(0, len(weight) - 1)]
    points = _within_texels(directions[chosen], texel)
    return vector, color, points, points[_rim(points @ axes.T)]


def _place_on_curve(places: np.ndarray) -> np.ndarray:
    """Return the position of places of a plane, (n, 2), on a curve whose parts are compact, (n,), int64.

    Morton's order: the bits of both coordinates in turn.
    """
    span = np.maximum(np.ptp(places, axis=0), 1e-9).max()
    cells = ((places - places.min(axis=0)) / span * (CURVE_STEPS - 1)).astype(np.int64)
    bits = np.arange(int(CURVE_STEPS).bit_length())
    spread = ((cells[..., None] >> bits) & 1) << (2 * bits)
    return spread[:, 0].sum(axis=-1) + 2 * spread[:, 1].sum(axis=-1)


def _within_texels(directions: np.ndarray, texel: float) -> np.ndarray:
    """Return directions spread evenly over the texels whose centers are given, (n, 3)."""
    number = np.arange(len(directions))
    # The R2 sequence of Roberts, 2018.
    right, down = (number[:, None] * [0.7548776662466927, 0.5698402909980532] % 1.0 - 0.5).T * texel
    polar = np.clip(np.arccos(np.clip(directions[:, 2], -1, 1)) + down, 0, np.pi)
    azimuth = np.arctan2(directions[:, 1], directions[:, 0]) - right
    ring = np.sin(polar)
    return np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), np.cos(polar)], axis=1)


def _rim(places: np.ndarray) -> np.ndarray:
    """Return the numbers of places, (n, 2), farthest out along even directions, and of one in the middle."""
    angle = np.arange(RIM_POINTS - 1) / (RIM_POINTS - 1) * 2 * np.pi
    outward = np.stack([np.cos(angle), np.sin(angle)])
    # A lamp may be small and have a wide, faint rim.
    middle = np.linalg.norm(places - np.median(places, axis=0), axis=1).argmin()
    return np.append((places @ outward).argmax(axis=0), middle)


def _pack(spots: list[tuple[np.ndarray, ...]]) -> KeyLights:
    keys = KeyLights()
    keys.count = len(spots)
    if spots:
        vectors, colors, points, rims = (
            np.stack(part).astype(np.float32) for part in zip(*spots, strict=True)
        )
        keys.vectors = wp.array(vectors, dtype=wp.vec3, device="cpu")
        keys.colors = wp.array(colors, dtype=wp.vec3, device="cpu")
        keys.strengths = wp.array(colors @ LUMINANCE, dtype=float, device="cpu")
        keys.points = wp.array(points, dtype=wp.vec3, device="cpu")
        keys.rims = wp.array(rims, dtype=wp.vec3, device="cpu")
    return keys


# The blurred copies hold roughness 0.2, 0.4 ... 1; between 0 and 0.2 the sharp panorama mixes in.
SPECULAR_COPIES = 5
SPECULAR_WIDTH = 128
SPECULAR_HEIGHT = 64

TWO_PI = wp.constant(2.0 * np.pi)
PI = wp.constant(np.pi)
HALF_PI = wp.constant(0.5 * np.pi)


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
    specular: Panorama  # its levels are the blurred copies, all SPECULAR_WIDTH x SPECULAR_HEIGHT
    rest: Panorama  # the same without the spots
    mirror_level: float


@wp.func
def angle_of(y: float, x: float) -> float:
    """atan2 within 1e-7; that of the C library takes longer than all else in a pixel of the surround.

    The polynomial is 4.4.49 of Abramowitz and Stegun, "Handbook of Mathematical Functions".
    """
    across = wp.abs(x)
    up = wp.abs(y)
    slope = wp.min(across, up) / wp.max(wp.max(across, up), 1.0e-30)
    s = slope * slope
    series = -0.0161657367 + 0.0028662257 * s
    series = 0.1065626393 + s * (-0.0752896400 + s * (0.0429096138 + s * series))
    series = 1.0 + s * (-0.3333314528 + s * (0.1999355085 + s * (-0.1420889944 + s * series)))
    angle = slope * series
    angle = wp.where(up > across, HALF_PI - angle, angle)
    angle = wp.where(x < 0.0, PI - angle, angle)
    return wp.where(y < 0.0, -angle, angle)


@wp.func
def panorama_uv(direction: wp.vec3) -> wp.vec2:
    """Position in the panorama, both in 0..1, of a unit direction; see `panorama_directions`."""
    ring = wp.sqrt(direction[0] * direction[0] + direction[1] * direction[1])
    u = 0.5 - angle_of(direction[1], direction[0]) / TWO_PI
    return wp.vec2(u, angle_of(ring, direction[2]) / PI)


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
    x0 = wp.where(left < 0, left + width, left)
    x1 = wp.where(left + 1 < width, left + 1, 0)
    first = panorama.offsets[level]
    row0 = first + wp.clamp(top, 0, height - 1) * width
    row1 = first + wp.clamp(top + 1, 0, height - 1) * width
    above = wp.lerp(panorama.texels[row0 + x0], panorama.texels[row0 + x1], fx)
    below = wp.lerp(panorama.texels[row1 + x0], panorama.texels[row1 + x1], fx)
    return wp.lerp(above, below, fy)


@wp.func
def panorama_at(panorama: Panorama, uv: wp.vec2, level: float) -> wp.vec3:
    """Trilinear value of the panorama at a position of `panorama_uv`; level 0 is the finest."""
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
def copies_light(copies: Panorama, copy: int, along: float, uv: wp.vec2) -> wp.vec3:
    """A value between a blurred copy and the next one; that of the first one for ``along`` below 0."""
    smooth = sample_panorama_level(copies, copy, uv)
    if along <= 0.0:
        return smooth
    return wp.lerp(smooth, sample_panorama_level(copies, copy + 1, uv), along)


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
        sharp = panorama_at(light.panorama, uv, light.mirror_level)
        if spots < 1.0:
            dimmed = wp.min(light.keys.level / wp.max(luminance(sharp), 1.0e-9), 1.0)
            sharp = wp.lerp(dimmed, 1.0, spots) * sharp
        light_here = wp.lerp(sharp, light_here, along + 1.0)
    return light_here
