"""The images of an infrared pair: the brightness of the scene, and the projector's dot pattern on it.

The renderer knows the scene in three visible colors. Infrared light is reflected otherwise (cloth and plants
are mostly brighter, prints are paler), and no mesh says how: luminance stands for it.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.color.adaptation import LUMINANCE
from digs_warp.sim.sensor.color.encoding import decode, encode
from digs_warp.sim.sensor.color.image_noise import noise_sigma

# Angles that the pattern fills, across and down [deg]. Vendor: D435's projector, 86 +- 3 and 57 +- 3
# (manual of the FRAMOS D435e, 3.3).
FIELD_DEG = (86.0, 57.0)

# Dots per unit of the plane [measured]: 3,990 in the field. Intel says about 5,000 ("Projectors for D400
# Series Depth Cameras", 1).
DENSITY = 1970.0

# Least distance of two dots, as a share of the mean spacing [measured].
LEAST_DISTANCE = 0.76

# Standard deviation of the spot on the plane, blur of the lens included [measured]: with it, spots in 8-bit
# images are as wide as real ones, 1.07 px of 427.
SPOT = 0.002

# Standard deviation of the logarithm of the dots' brightness [measured].
BRIGHTNESS_SPREAD = 0.3

# Every unit has the same pattern: errors must not depend on the seed of a recording.
SEED = 435

# Candidates per round of `_scattered`.
ROUND = 4000


@dataclass(frozen=True, eq=False)
class DotPattern:
    """Dots sorted into square cells, at most one in each.

    Attributes:
        dots: x, y on the plane and brightness (1: mean), (rows, columns, 3), float32; brightness 0: no dot.
        left, top: corner of the first cell on the plane.
        cell: side of a cell; the spots of farther cells than the next do not reach.
    """

    dots: np.ndarray
    left: float
    top: float
    cell: float


@cache
def dot_pattern() -> DotPattern:
    """Return the pattern, the same each time."""
    half = np.tan(np.deg2rad(FIELD_DEG) / 2)
    count = round(DENSITY * 4 * half[0] * half[1])
    least = LEAST_DISTANCE / np.sqrt(DENSITY)
    rng = np.random.default_rng(SEED)
    places = _scattered(rng, half, count, least)
    brightness = np.exp(BRIGHTNESS_SPREAD * rng.standard_normal(count))
    cell = least / np.sqrt(2)  # the diagonal is the least distance
    columns, rows = np.ceil(2 * half / cell).astype(int)
    dots = np.zeros((rows, columns, 3), dtype=np.float32)
    column, row = np.floor((places + half) / cell).astype(int).T
    dots[row, column, :2] = places
    dots[row, column, 2] = brightness / brightness.mean()
    return DotPattern(dots, -float(half[0]), -float(half[1]), float(cell))


def _scattered(rng: np.random.Generator, half: np.ndarray, count: int, least: float) -> np.ndarray:
    """Return random points no closer than ``least``, (count, 2): those that come too near are drawn again."""
    from scipy.spatial import KDTree  # pyright: ignore[reportAttributeAccessIssue]

    points = np.empty((0, 2))
    while len(points) < count:
        new = rng.uniform(-half, half, (ROUND, 2))
        if len(points):
            new = new[KDTree(points).query(new)[0] >= least]
        pairs = KDTree(new).query_pairs(least, output_type="ndarray")
        new = np.delete(new, np.unique(pairs[:, 1]), axis=0)
        points = np.concatenate([points, new])
    return points[:count]


# Plain walls get no depth from dots that are weaker than this many standard deviations of the image noise
# [measured: on the gray box of the sample pair of a D435].
STANDS_OUT = 3.0


def infrared_image(image: np.ndarray) -> np.ndarray:
    """Return the brightness of a rendered image in three equal channels, (height, width, 3), uint8."""
    return in_three_channels(encode(decode(image) @ LUMINANCE))


def with_dots(infrared: np.ndarray, dots: np.ndarray) -> np.ndarray:
    """Return an infrared image with the light of the projector.

    Args:
        infrared: (height, width, 3), uint8, equal channels.
        dots: linear, 1 is white, (height, width), float32.
    """
    return in_three_channels(encode(decode(infrared[..., 0]) + dots))


def stands_out(infrared: np.ndarray, peak: np.ndarray, rig: StereoRig) -> np.ndarray:
    """Return where the center of a dot is brighter than its surroundings by STANDS_OUT times the image noise.

    Rounding to eight bits is noise, too. Light beyond white does not show.

    Args:
        infrared: without dots, (height, width, 3), uint8, equal channels.
        peak: light of the center of a mean dot at each pixel, linear, (height, width), float32.
        rig: its noise.

    Returns:
        (height, width), bool.
    """
    gray = infrared[..., 0]
    light = decode(gray)
    step = decode(np.minimum(gray, 254) + np.uint8(1)) - decode(np.minimum(gray, 254))
    noise = np.hypot(noise_sigma(light, rig), step / np.sqrt(12))
    return np.minimum(peak, 1 - light) > STANDS_OUT * noise


def in_three_channels(gray: np.ndarray) -> np.ndarray:
    """Return a gray image, (height, width), as the effects on images expect it, (height, width, 3)."""
    return np.repeat(gray[..., None], 3, axis=2)
