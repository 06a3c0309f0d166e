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
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.seen_colors import SeenColors, colors_in, look_up
from digs_warp.measure.color_gain import DARK, OFFSET, SATURATED, STOPS_PER_LOG, ColorGain

# Points that tell the exposures.
POINTS = 4000
# Where the exposure is constant, factors of up to 0.1 stops are found, root mean square (an armchair of shiny
# leather); where it follows the light four times too far, they are 0.1 stops off, of 0.8.
NOISE_STOPS = 0.15
# Rounds of reweighting: highlights, and what hides a point, hardly count. A difference that is larger than
# usual weighs less by the square of that, so that it pulls the less, the larger it is: where one photograph
# shows a highlight and the next one none, it would pull both together.
ROUNDS = 12
# The last round is the first one that changes no logarithm by more: 0.0014 stops.
SETTLED = 1e-3
# Usual are differences up to this many median ones, and all below about two steps of 8 bits.
USUAL, LEAST = 2.0, 0.02


def without_exposure(
    points: PointCloud, frames: Sequence[Frame], seen: SeenColors | None = None
) -> PointCloud:
    """Return points in the colors that they have in photographs of one exposure.

    Points keep their colors where they are seen by none, where the exposure is constant, and in a recording
    without depth, which does not tell who sees what.

    Args:
        points: the first ones.
        frames: to train on.
        seen: some of the points in some of the frames; None: they are looked up.
    """
    if not len(points) or not all(frame.has(Layer.DEPTH) for frame in frames):
        return points
    if seen is None or seen.colors.shape[1] < len(frames):
        seen = look_up(frames, points.points_world, POINTS, len(frames))
    factors = exposures(seen.colors)
    if not factors.any():
        return points
    return replace(points, colors=_evened(points, frames, factors))


def exposures(colors: np.ndarray) -> np.ndarray:
    """Return the logarithms of the factors of m photographs, (m,); all are 0 where the exposure is constant.

    Args:
        colors: of points in the photographs, as of `SeenColors`, shape (n, m, 3).
    """
    some = colors[:: max(1, len(colors) // POINTS)]
    factors = log_factors(np.concatenate([some[..., channel] for channel in range(3)]))
    varies = STOPS_PER_LOG * float(np.sqrt(np.mean(factors**2))) > NOISE_STOPS
    return factors if varies else np.zeros_like(factors)


def in_one_exposure(colors: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """Return colors (..., 3) without the factors (...) of their photographs; not clipped."""
    scale, shift = ColorGain(factors[..., None]).removal()
    return scale * colors + shift


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


def _evened(points: PointCloud, frames: Sequence[Frame], factors: np.ndarray) -> np.ndarray:
    """Return the mean color of each point in its photographs, all of one exposure, (n, 3)."""
    sums, counts = np.zeros((len(points), 3)), np.zeros((len(points), 1))
    for frame, factor in zip(frames, factors, strict=True):
        colors = in_one_exposure(colors_in(points.points_world, frame), factor)
        is_seen = np.isfinite(colors[:, :1])
        sums += np.where(is_seen, colors, 0.0)
        counts += is_seen
    means = np.clip(sums / np.maximum(counts, 1), 0.0, 1.0)
    return np.where(counts > 0, means, points.colors)
