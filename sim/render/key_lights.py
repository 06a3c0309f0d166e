"""The bright spots of an environment (sun, lamps, windows), separated from it so that they cast shadows.

The rest is smooth and lights a surface through spherical harmonics. Each spot is a directional light; which
share of it a surface sees is measured with rays toward points of it, see `digs_warp.sim.render.shadows`.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.sim.scene.panorama import panorama_directions, solid_angles

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


@dataclass(frozen=True, eq=False)
class Spot:
    """Direction of the vector irradiance (3,), color (3,), points (SPOT_POINTS, 3), rim (RIM_POINTS, 3)."""

    vector: np.ndarray
    color: np.ndarray
    points: np.ndarray
    rim: np.ndarray


def _spot(directions: np.ndarray, flux: np.ndarray, texel: float) -> Spot:
    """Return one spot.

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
    return Spot(vector, color, points, points[_rim(points @ axes.T)])


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


def _pack(spots: list[Spot]) -> KeyLights:
    keys = KeyLights()
    keys.count = len(spots)
    if spots:
        vectors, colors, points, rims = (
            np.stack([getattr(spot, part) for spot in spots]).astype(np.float32)
            for part in ("vector", "color", "points", "rim")
        )
        keys.vectors = wp.array(vectors, dtype=wp.vec3, device="cpu")
        keys.colors = wp.array(colors, dtype=wp.vec3, device="cpu")
        keys.strengths = wp.array(colors @ LUMINANCE, dtype=float, device="cpu")
        keys.points = wp.array(points, dtype=wp.vec3, device="cpu")
        keys.rims = wp.array(rims, dtype=wp.vec3, device="cpu")
    return keys
