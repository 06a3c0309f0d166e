"""The scale between structure from motion and metres (paper section 3.3.1, eq. 6 and 7).

Every observation of a sparse point gives one ratio of its depth in the model, d* [sfm], to the depth that
the sensor measured there, d [m]. Most ratios agree. Sensor noise widens the peak; mismatches, rims of holes
and occlusions are spread everywhere. The scale is the maximum of a kernel density estimate of all ratios.

Stereo noise is symmetric in disparity, which is proportional to 1 / d, so the peak of d*/d is unbiased. The
distribution of d/d* would be skewed, and its peak shifted by twice the squared relative noise.

Bandwidth: the peak of a density is where its derivative vanishes, so the rule is the normal-scale rule for
the *derivative*, h = (4 / 5)^(1/7) s n^(-1/7) (Chacon, Duong and Wand 2011, Statistica Sinica 21, eq. 3.2
at dimension 1 and order 1). Here s is the standard deviation and n the size of the peak alone, so that
outliers do not widen the kernel. Both are measured at the peak: first from the densest interval, then from
the peak's width at half its height.
"""

import logging
from dataclasses import dataclass

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.words import counted

logger = logging.getLogger(__name__)

BINS_PER_BANDWIDTH = 20
REACH = 6.0  # bandwidths beyond which the kernel is negligible (exp(-18) = 1.5e-8)

# The shortest interval with this share of the values, and at least this many, gives the first estimate of the
# peak. With few values it is the shortest half.
CORE_SHARE = 0.05
CORE_COUNT = 20
REFINEMENTS = 3

# Smallest spread [relative] of a peak: float32 depths cannot resolve less.
RELATIVE_RESOLUTION = 1e-6

# Only cells with at least this share of the fullest cell can hold a mode that is reported.
CANDIDATE_SHARE = 0.5
# A mode rises above its surroundings by at least this share of the highest mode; less is sampling noise.
MODE_PROMINENCE = 0.15
# A second mode of at least this relative height makes the choice of the first one doubtful.
RIVAL_HEIGHT = 0.8

# Half the width of a normal distribution at half its height, in standard deviations.
HALF_WIDTH = float(np.sqrt(2 * np.log(2)))


@dataclass(frozen=True)
class ScaleEstimate:
    """The factor between the units of structure from motion and metres.

    Attributes:
        sfm_per_metre: the most probable ratio, sigma* of eq. 7.
        width: standard deviation of the peak around it [sfm / m].
        values: number of ratios used.
        modes: number of distinct peaks of the density.
        bandwidth: of the kernel [sfm / m].
        warning: why the result is doubtful; empty if it is not.
    """

    sfm_per_metre: float
    width: float
    values: int
    modes: int
    bandwidth: float
    warning: str = ""

    def __str__(self) -> str:
        spread = 100 * self.width / self.sfm_per_metre
        known = f"{self.sfm_per_metre:.4f} units of the model per metre, spread {spread:.2f} %"
        peaks = counted(self.modes, "peak")
        warning = f"; warning: {self.warning}" if self.warning else ""
        return f"{known} over {counted(self.values, 'measurement')}, {peaks}{warning}"


def estimate_scale(ratios: np.ndarray) -> ScaleEstimate:
    """Return the mode of the ratios d*/d (eq. 7), with a warning if a second mode is nearly as high.

    With 10^6 ratios the relative error of the mode is below 10^-3, whatever the share of outliers, as long as
    the peak is denser than they are.

    Args:
        ratios: local scales [sfm / m], any shape; NaN, infinite, zero and negative ones are ignored.

    Raises:
        DigsError: no usable ratio.
    """
    values = np.sort(_usable(ratios))
    location, deviation, count = _core(values)
    for _ in range(REFINEMENTS):
        bandwidth = _bandwidth(location, deviation, count)
        modes, _ = _modes(values, bandwidth)
        deviation, count = _peak_spread(values, modes[0], bandwidth)
        location = modes[0]
    bandwidth = _bandwidth(location, deviation, count)
    modes, heights = _modes(values, bandwidth)
    width, _ = _peak_spread(values, modes[0], bandwidth)
    warning = _rival_warning(modes, heights)
    if warning:
        logger.warning(warning)
    return ScaleEstimate(float(modes[0]), width, len(values), len(modes), bandwidth, warning)


def log_density(values: np.ndarray, at: np.ndarray, bandwidth: float) -> np.ndarray:
    """Return the logarithm of the Gaussian kernel density of sorted ``values``, shape of ``at``.

    Values are first counted in bins of a twentieth of the bandwidth. This changes the density by less than
    10^-3 (the variance of a uniform bin widens the kernel by a relative h^2 / 4800).
    """
    from sklearn.neighbors import KernelDensity

    bin_width = bandwidth / BINS_PER_BANDWIDTH
    near = _near(values, at, REACH * bandwidth)
    bins, counts = np.unique(np.floor(near / bin_width), return_counts=True)
    density = KernelDensity(bandwidth=bandwidth, rtol=1e-6)  # pyright: ignore[reportArgumentType]
    density.fit(((bins + 0.5) * bin_width)[:, None], sample_weight=counts)
    # scikit-learn normalizes by the weights it was given; values out of reach must count, too.
    return density.score_samples(at[:, None]) + np.log(len(near) / len(values))


def _usable(ratios: np.ndarray) -> np.ndarray:
    ratios = np.asarray(ratios, dtype=np.float64).ravel()
    usable = ratios[np.isfinite(ratios) & (ratios > 0)]
    if usable.size == 0:
        raise DigsError(
            f"scale: {ratios.size} points of structure from motion fall on measured depth, none of them "
            "with a finite ratio above 0; check that the depth maps belong to the images, or use "
            "the poses of the capture (--poses capture)"
        )
    return usable


def _core(values: np.ndarray) -> tuple[float, float, int]:
    """Return center, standard deviation and size of the densest part of sorted values."""
    few = min(CORE_COUNT, len(values) // 2 + 1)
    inside = max(few, int(CORE_SHARE * len(values)))
    widths = values[inside - 1 :] - values[: len(values) - inside + 1]
    first = int(np.argmin(widths))
    location = float(values[first + inside // 2])
    # The densest p of a normal distribution spans 2 * (the quantile of 1/2 + p/2) deviations.
    from scipy.special import ndtri

    span = 2.0 * float(ndtri(0.5 + 0.5 * min(0.95, inside / len(values))))
    return location, float(widths[first]) / span, inside


def _bandwidth(location: float, deviation: float, count: int) -> float:
    deviation = max(deviation, RELATIVE_RESOLUTION * location)
    return float((4 / 5) ** (1 / 7) * deviation * max(count, 1) ** (-1 / 7))


def _peak_spread(values: np.ndarray, location: float, bandwidth: float) -> tuple[float, int]:
    """Return standard deviation and size of the peak, from its width at half its height."""
    step = bandwidth / 4
    reach = 4
    while True:
        at = location + step * np.arange(-reach, reach + 1)
        height = np.exp(log_density(values, at, bandwidth))
        low = np.flatnonzero(height < 0.5 * height[reach])
        left, right = low[low < reach], low[low > reach]
        if left.size and right.size:
            break
        reach *= 2
    half_width = step * min(right[0] - reach, reach - left[-1]) / HALF_WIDTH
    # The kernel's variance adds to that of the peak.
    deviation = float(np.sqrt(max(half_width**2 - bandwidth**2, 0.0)))
    deviation = float(max(deviation, RELATIVE_RESOLUTION * location))
    low_end, high_end = np.searchsorted(
        values, [location - 3 * deviation, location + 3 * deviation]
    )
    return deviation, int(high_end - low_end)


def _modes(values: np.ndarray, bandwidth: float) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and relative heights of the distinct modes, the highest first."""
    from scipy.signal import find_peaks

    grid = _candidates(values, bandwidth)
    density = np.exp(log_density(values, grid, bandwidth))
    # A gap in the grid is empty of values: let the density fall to zero there.
    gap = np.flatnonzero(np.diff(grid) > 1.5 * bandwidth / BINS_PER_BANDWIDTH) + 1
    grid = np.concatenate([[grid[0]], np.insert(grid, gap, grid[gap]), [grid[-1]]])
    density = np.concatenate([[0.0], np.insert(density, gap, 0.0), [0.0]])
    peaks, _ = find_peaks(density, prominence=MODE_PROMINENCE * density.max())
    order = np.argsort(-density[peaks], kind="stable")
    return grid[peaks][order], density[peaks][order] / density.max()


def _candidates(values: np.ndarray, bandwidth: float) -> np.ndarray:
    """Return bin centers around all positions that can hold a relevant mode, ascending."""
    cells = np.unique(np.floor(values / bandwidth))
    ends = np.searchsorted(values, [(cells - 1) * bandwidth, (cells + 2) * bandwidth])
    full = ends[1] - ends[0]
    cells = cells[full >= CANDIDATE_SHARE * full.max()]
    cells = np.unique(cells[:, None] + np.arange(-2, 3))
    offsets = (np.arange(BINS_PER_BANDWIDTH) + 0.5) / BINS_PER_BANDWIDTH
    return ((cells[:, None] + offsets) * bandwidth).ravel()


def _near(values: np.ndarray, at: np.ndarray, reach: float) -> np.ndarray:
    """Return the sorted values within ``reach`` of any of the ascending positions ``at``."""
    gaps = np.flatnonzero(np.diff(at) > 2 * reach)
    starts = np.concatenate([at[:1], at[gaps + 1]]) - reach
    ends = np.concatenate([at[gaps], at[-1:]]) + reach
    first, last = np.searchsorted(values, starts), np.searchsorted(values, ends, side="right")
    return np.concatenate([values[a:b] for a, b in zip(first, last, strict=True)])


def _rival_warning(modes: np.ndarray, heights: np.ndarray) -> str:
    if len(modes) < 2 or heights[1] < RIVAL_HEIGHT:
        return ""
    return (
        f"scale: a second mode at {modes[1]:.5g} sfm per metre is {heights[1]:.0%} as high as the one "
        f"at {modes[0]:.5g} that was used; check the depth unit of all frames and the masks"
    )
