"""The exposure of the photographs before the training, and colors without it.

A camera that adapts to the light makes one side of an object brighter than the other. The colors of the first
points are those of the photographs that see them: taken as they are, most of the exposure looks like the
object's own color. The training then finds gains and colors in turns, but while colors are wrong, photographs
from two sides contradict each other, and the Gaussians move until they fit both. So the exposures are found
before, all at once. With s the factor of a photograph and x the color of a point
(`digs_warp.measure.color_gain`),

    log(y + 0.055) = log s + log(x + 0.055)

is solved by least squares over all points and photographs, from which the points are eliminated. The channels
share their factor: in a dark one, reflections would look like exposure. The training tells white balance.

Some exposure is always found: a shiny object is brighter from where it reflects the sky, which looks like a
longer exposure. A real change of exposure explains most of the differences between photographs, at every
point; gloss explains little of them. So gains are believed only where they explain enough;
otherwise, the exposure is constant.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.seen_colors import SeenColors, colors_in, look_up
from digs_warp.measure.color_gain import OFFSET, SATURATED, joint_log_factors

# Points that tell the exposures.
POINTS = 2000
# What gains have to explain of the mean square of what differs without them. Where the exposure
# is constant, they explain at most 0.07 (a flight helmet, a case of polished metal, a cow, a box), in images
# of 72x54 pixels 0.24; where they are not, 0.27 or more.
LEAST_EXPLAINED = 0.25


@dataclass(frozen=True, eq=False)
class FirstExposures:
    """What differs between m photographs beside what they show; all 0 where it is constant.

    Attributes:
        log_factors: logarithms of the factors, as of `ColorGain`, for all channels, shape (m,).
        vary: whether gains, white balance included, explain enough to be believed.
    """

    log_factors: np.ndarray
    vary: bool

    @staticmethod
    def of(colors: np.ndarray) -> "FirstExposures":
        """Find them from the colors of n points in the photographs, as of `SeenColors`, shape (n, m, 3)."""
        some = colors[:: max(1, len(colors) // POINTS)]
        some = np.where(some >= SATURATED / 255.0, np.nan, some)  # tells only a lower bound
        channels = [some[..., channel] for channel in range(3)]
        gains = np.stack([*map(joint_log_factors, channels)], axis=1)
        before, after = (_differences(some, each) for each in (np.zeros_like(gains), gains))
        if after >= (1.0 - LEAST_EXPLAINED) * before:
            return FirstExposures(np.zeros(some.shape[1]), vary=False)
        return FirstExposures(joint_log_factors(np.concatenate(channels)), vary=True)

    def removed(self, colors: np.ndarray, of: int | slice = slice(None)) -> np.ndarray:
        """Return colors as in photographs of one exposure; not clipped.

        Args:
            colors: in all photographs (n, m, 3), or in one of them (n, 3).
            of: number of that photograph.
        """
        return np.exp(-self.log_factors[of, None]) * (colors + OFFSET) - OFFSET


def first_exposures(
    points: PointCloud, frames: Sequence[Frame], seen: SeenColors | None = None
) -> FirstExposures | None:
    """Return the exposures of the frames; None without points, or depth that tells who sees what.

    Args:
        points: the first ones.
        frames: to train on.
        seen: some of the points in some of the frames; None: they are looked up.
    """
    told = points.agreement is not None or all(frame.has(Layer.DEPTH) for frame in frames)
    if not len(points) or not told:
        return None
    if seen is None or seen.colors.shape[1] < len(frames):
        seen = look_up(frames, points.points_world, POINTS, len(frames))
    return FirstExposures.of(seen.colors)


def without_exposure(
    points: PointCloud, frames: Sequence[Frame], found: FirstExposures
) -> PointCloud:
    """Return points in their mean colors in photographs of one exposure.

    Points keep their colors where they are seen by none, and where the exposure is constant.

    Args:
        points: the first ones.
        frames: to train on.
        found: of the frames.
    """
    if not found.vary:
        return points
    sums, counts = np.zeros((len(points), 3)), np.zeros((len(points), 1))
    for number, frame in enumerate(frames):
        colors = found.removed(colors_in(points.points_world, frame, points.points_world), number)
        is_seen = np.isfinite(colors[:, :1])
        sums += np.where(is_seen, colors, 0.0)
        counts += is_seen
    means = np.clip(sums / np.maximum(counts, 1), 0.0, 1.0)
    return replace(points, colors=np.where(counts > 0, means, points.colors))


def _differences(colors: np.ndarray, log_gains: np.ndarray) -> float:
    """Return how far photographs without these gains (m, 3) are from the median one.

    It is the mean square, over the photographs, of the median over the points: highlights and what hides a
    point do not count, but a few photographs of another exposure do.
    """
    even = np.exp(-log_gains) * (colors + OFFSET)
    values = np.concatenate([*np.moveaxis(even, 2, 0)])
    values = values[np.isfinite(values).sum(axis=1) >= 2]
    if not len(values):
        return 0.0
    misses = np.abs(values - np.nanmedian(values, axis=1, keepdims=True))
    usual = [np.median(own[np.isfinite(own)]) for own in misses.T if np.isfinite(own).any()]
    return float(np.mean(np.square(usual)))
