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
The lift of each photograph (`digs_warp.measure.color_lift`) follows from the mean colors of the points
without these factors, and the factors then from the photographs without their lifts.

Some exposure is always found: a shiny object is brighter from where it reflects the sky, which looks like a
longer exposure. A real change of exposure explains most of the differences between photographs, at every
point; gloss explains little of them. So gains and lifts are believed only where they explain enough;
otherwise, the exposure is constant.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.seen_colors import SeenColors, colors_in, look_up
from digs_warp.measure.color_gain import DARK, OFFSET, SATURATED
from digs_warp.measure.color_lift import fit_lift

# Points that tell the exposures.
POINTS = 2000
# What gains or lifts have to explain of the mean square of what differs without them. Where exposure and tone
# are constant, they explain at most 0.07 (a flight helmet, a case of polished metal, a cow, a box), in images
# of 72x54 pixels 0.24; where they are not, 0.27 or more.
LEAST_EXPLAINED = 0.25
# Rounds of reweighting: highlights, and what hides a point, hardly count. A difference that is larger than
# usual weighs less by the square of that, so that it pulls the less, the larger it is: where one photograph
# shows a highlight and the next one none, it would pull both together.
ROUNDS = 12
# The last round is the first one that changes no logarithm by more: 0.0014 stops.
SETTLED = 1e-3
# Usual are differences up to this many median ones, and all below about two steps of 8 bits.
USUAL, LEAST = 2.0, 0.02


@dataclass(frozen=True, eq=False)
class FirstExposures:
    """What differs between m photographs beside what they show; all 0 where it is constant.

    Attributes:
        log_factors: logarithms of the factors, as of `ColorGain`, for all channels, shape (m,).
        lifts: see `digs_warp.measure.color_lift`, shape (m,).
        vary: whether gains, white balance included, or lifts explain enough to be believed.
    """

    log_factors: np.ndarray
    lifts: np.ndarray
    vary: bool

    @staticmethod
    def of(colors: np.ndarray) -> "FirstExposures":
        """Find them from the colors of n points in the photographs, as of `SeenColors`, shape (n, m, 3)."""
        some = colors[:: max(1, len(colors) // POINTS)]
        some = np.where(clipped(some), np.nan, some)
        none = np.zeros(some.shape[1])
        gains = _log_gains(some)
        lifts = _lifts(some, gains)
        without = _differences(some, np.zeros_like(gains), none)
        by_gains = _differences(some, gains, none)
        by_both = _differences(some, _log_gains(some - lifts[:, None]), lifts)
        lifted = _explain(by_gains, by_both)
        if not lifted and not _explain(without, by_gains):
            return FirstExposures(none, none, vary=False)
        lifts = lifts if lifted else none
        return FirstExposures(log_factors(_by_channel(some - lifts[:, None])), lifts, vary=True)

    def removed(self, colors: np.ndarray, of: int | slice = slice(None)) -> np.ndarray:
        """Return colors as in photographs of one exposure; not clipped.

        Args:
            colors: in all photographs (n, m, 3), or in one of them (n, 3).
            of: number of that photograph.
        """
        lights = colors + OFFSET - self.lifts[of, None]
        return np.exp(-self.log_factors[of, None]) * lights - OFFSET


def clipped(colors: np.ndarray) -> np.ndarray:
    """Return which values of photographs tell only a lower bound; NaN does not."""
    return colors >= SATURATED / 255.0


def first_exposures(
    points: PointCloud, frames: Sequence[Frame], seen: SeenColors | None = None
) -> FirstExposures | None:
    """Return the exposures of the frames; None without points, or depth, which tells who sees what.

    Args:
        points: the first ones.
        frames: to train on.
        seen: some of the points in some of the frames; None: they are looked up.
    """
    if not len(points) or not all(frame.has(Layer.DEPTH) for frame in frames):
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
        colors = found.removed(colors_in(points.points_world, frame), number)
        is_seen = np.isfinite(colors[:, :1])
        sums += np.where(is_seen, colors, 0.0)
        counts += is_seen
    means = np.clip(sums / np.maximum(counts, 1), 0.0, 1.0)
    return replace(points, colors=np.where(counts > 0, means, points.colors))


def log_factors(values: np.ndarray) -> np.ndarray:
    """Return the logarithms of the factors of m photographs, shape (m,); their mean is 0.

    A photograph that shares no point with another has 0.

    Args:
        values: one channel of n points, sRGB in 0..1, NaN where a point is not seen, shape (n, m).
    """
    with np.errstate(invalid="ignore"):
        told = (values > DARK) & (values < SATURATED / 255.0)
    told &= told.sum(axis=1, keepdims=True) >= 2
    count = values.shape[1]
    if not told.any():
        return np.zeros(count)
    # Only where a photograph tells a point, one point after the other: that is a third of all.
    point, photo = np.nonzero(told[told.any(axis=1)])
    starts = np.flatnonzero(np.diff(point, prepend=-1))

    def sums(each: np.ndarray) -> np.ndarray:
        return np.add.reduceat(each, starts)[point]

    light = values[told] + OFFSET
    logs, usual = np.log(light), light**2  # an error of y is one of log y times y
    weights, found = usual, np.zeros(count)
    roots = np.zeros((len(starts), count))
    for _ in range(ROUNDS):
        totals = sums(weights)
        shares = weights / totals
        apart = logs - sums(shares * logs)
        roots[point, photo] = weights / np.sqrt(totals)
        # Not a product of matrices: its sums depend on the number of threads, and these wait for each other.
        normal = np.diag(_by(photo, weights, count)) - np.einsum("nm,nk->mk", roots, roots)
        before = found
        found = np.linalg.lstsq(normal, _by(photo, weights * apart, count), rcond=1e-9)[0]
        if np.abs(found - before).max() < SETTLED:
            break
        even = logs - found[photo]
        misses = light * np.abs(even - sums(shares * even))
        allowed = max(USUAL * float(np.median(misses)), LEAST)
        weights = usual * (allowed / np.maximum(misses, allowed)) ** 2
    return found - found.mean()


def _by(photo: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Return the sum of the values of each of ``count`` photographs."""
    return np.bincount(photo, values, count)


def _by_channel(colors: np.ndarray) -> np.ndarray:
    """Return the values (3 n, m) of colors (n, m, 3), one channel after the other."""
    return np.concatenate([colors[..., channel] for channel in range(3)])


def _log_gains(colors: np.ndarray) -> np.ndarray:
    """Return the logarithms of the factors of each channel, (m, 3)."""
    return np.stack([log_factors(colors[..., channel]) for channel in range(3)], axis=1)


def _lifts(colors: np.ndarray, log_gains: np.ndarray) -> np.ndarray:
    """Return the lifts of photographs of these gains (m, 3), shape (m,); their mean is 0."""
    even = np.exp(-log_gains) * (colors + OFFSET) - OFFSET
    is_seen = np.isfinite(even)
    counts = is_seen.sum(axis=1)
    sums = np.where(is_seen, even, 0.0).sum(axis=1)
    means = np.where(counts >= 2, sums / np.maximum(counts, 1), np.nan)
    found = np.array([fit_lift(means, photograph) for photograph in np.moveaxis(colors, 1, 0)])
    return found - found.mean() if len(found) else found


def _differences(colors: np.ndarray, log_gains: np.ndarray, lifts: np.ndarray) -> float:
    """Return how far photographs without these gains (m, 3) and lifts (m,) are from the median one.

    It is the mean square, over the photographs, of the median over the points: highlights and what hides a
    point do not count, but a few photographs of another exposure do.
    """
    even = np.exp(-log_gains) * (colors + OFFSET - lifts[:, None])
    values = _by_channel(even)
    values = values[np.isfinite(values).sum(axis=1) >= 2]
    if not len(values):
        return 0.0
    ordered = np.sort(values, axis=1)  # NaN comes last
    each, last = np.arange(len(values)), np.isfinite(values).sum(axis=1) - 1
    median = 0.5 * (ordered[each, last // 2] + ordered[each, (last + 1) // 2])
    misses = np.abs(values - median[:, None])
    usual = [np.median(own[np.isfinite(own)]) for own in misses.T if np.isfinite(own).any()]
    return float(np.mean(np.square(usual)))


def _explain(before: float, after: float) -> bool:
    """Whether enough of the mean squares is explained."""
    return after < (1.0 - LEAST_EXPLAINED) * before
