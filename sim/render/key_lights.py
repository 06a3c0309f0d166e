"""The bright spots of an environment (sun, lamps, windows), separated from it so that they cast shadows.

The rest is smooth and lights a surface through spherical harmonics. Each spot is a directional light with one
shadow ray toward a random point of it.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false

import numpy as np
import warp as wp

from digs_warp.sim.panorama import panorama_directions, solid_angles

wp.set_module_options({"enable_backward": False})

# A spot is brighter than this multiple of the mean radiance; only the excess is separated.
SPOT_LEVEL = 4.0

# Largest angular radius of a spot: wider ones have no sharp shadows.
SPOT_RADIUS_DEGREES = 18.0

# Largest number of spots, and their smallest share of all light.
MAX_SPOTS = 8
MIN_SHARE = 0.02

# Weights of red, green and blue (Rec. 709).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

# Points per spot for shadow rays.
SPOT_POINTS = 64


@wp.struct
class KeyLights:
    """The spots; a ``count`` of 0 costs nothing."""

    count: int
    vectors: wp.array[wp.vec3]  # [count] unit direction of the vector irradiance
    colors: wp.array[wp.vec3]  # [count] irradiance at normal incidence over pi, exposed
    strengths: wp.array[float]  # [count] luminance of the colors
    points: wp.array2d[wp.vec3]  # [count, SPOT_POINTS] unit directions of equal strength


@wp.func
def key_light(keys: KeyLights, normal: wp.vec3) -> wp.vec3:
    """Irradiance over pi of all spots, without shadows."""
    light = wp.vec3(0.0)
    for k in range(keys.count):
        light += wp.max(wp.dot(normal, keys.vectors[k]), 0.0) * keys.colors[k]
    return light


@wp.struct
class KeyChoice:
    """The direction of the shadow ray, and the light of all spots without shadows."""

    direction: wp.vec3
    strength: float


@wp.func
def choose_key(keys: KeyLights, normal: wp.vec3, pick: float) -> KeyChoice:
    """Choose a spot with a probability proportional to its light, and a point of it.

    The total light times the visibility of that point is an unbiased estimate of the shadowed light (for
    spots of one color). ``pick`` is uniform in 0..1.
    """
    choice = KeyChoice()
    for k in range(keys.count):
        cosine = wp.max(wp.dot(normal, keys.vectors[k]), 0.0)
        choice.strength = choice.strength + cosine * keys.strengths[k]
    threshold = pick * choice.strength
    passed = wp.float32(0.0)
    for k in range(keys.count):
        part = wp.max(wp.dot(normal, keys.vectors[k]), 0.0) * keys.strengths[k]
        if part > 0.0 and passed <= threshold:
            # The position of the random number within this spot's interval chooses the point.
            within = wp.clamp((threshold - passed) / part, 0.0, 0.99999)
            choice.direction = keys.points[k, int(within * float(SPOT_POINTS))]
        passed += part
    return choice


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
        spots.append(_spot(directions[inside], taken[inside] * areas[inside][:, None]))
        power = np.where(inside, 0.0, power)
    return np.maximum(smooth, 0.0).astype(np.float32), _pack(spots)


def _spot(directions: np.ndarray, flux: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vector direction (3,), color (3,) and points (SPOT_POINTS, 3) of one spot.

    Args:
        directions: of its pixels, shape (n, 3).
        flux: radiance times solid angle of each, shape (n, 3).
    """
    weight = flux @ LUMINANCE
    vector = weight @ directions
    # Less than the sum of the weights for wide spots: their parts have different directions.
    concentration = float(np.linalg.norm(vector) / weight.sum())
    shares = (np.arange(SPOT_POINTS) + 0.5) / SPOT_POINTS * weight.sum()
    chosen = np.searchsorted(np.cumsum(weight), shares).clip(0, len(weight) - 1)
    color = flux.sum(axis=0) * concentration / np.pi
    return vector / np.linalg.norm(vector), color, directions[chosen]


def _pack(spots: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> KeyLights:
    keys = KeyLights()
    keys.count = len(spots)
    if spots:
        vectors, colors, points = (
            np.stack(part).astype(np.float32) for part in zip(*spots, strict=True)
        )
        keys.vectors = wp.array(vectors, dtype=wp.vec3, device="cpu")
        keys.colors = wp.array(colors, dtype=wp.vec3, device="cpu")
        keys.strengths = wp.array(colors @ LUMINANCE, dtype=float, device="cpu")
        keys.points = wp.array(points, dtype=wp.vec3, device="cpu")
    return keys
