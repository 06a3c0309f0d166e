"""The scale between structure from motion and metres (paper section 3.3.1, eq. 6 and 7).

Every observation of a sparse point gives one ratio of its depth in the model, d* [sfm], to the depth that
the sensor measured there, d [m]. Most ratios agree. Sensor noise widens the peak; mismatches, rims of holes
and occlusions are spread everywhere. The scale is the maximum of a kernel density estimate of all ratios.

Stereo noise is symmetric in disparity, which is proportional to 1 / d, so the peak of d*/d is unbiased. The
distribution of d/d* would be skewed, and its peak shifted by twice the squared relative noise.

The density is that of the ratios, over bins of their logarithm. The peak of a density is where its derivative
vanishes, so the bandwidth follows the normal-scale rule for the *derivative*, h = (4 / 5)^(1/7) s n^(-1/7)
(Chacon, Duong and Wand 2011, Statistica Sinica 21, eq. 3.2 at dimension 1 and order 1), with the standard
deviation s and the number n of the values of the peak alone.
"""

import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.sfm_model import SfmModel
from digs_warp.device.threads import default_threads
from digs_warp.init.config import MASK_THRESHOLD, InitConfig
from digs_warp.record.progress import progress
from digs_warp.words import counted

logger = logging.getLogger(__name__)

# With fewer ratios inside the masks, the whole image is used, because an object can lack texture. On six
# recorded objects, the mode of 100 ratios from the object had a scale error of 0.2 %. The whole image, with
# surroundings that are far away and measured less precisely, had up to 0.4 %.
MIN_MASKED = 100

# The first bandwidth and the least one, relative to the scale, and how often it is chosen anew.
FIRST_BANDWIDTH, LEAST_BANDWIDTH, REFINEMENTS = 1e-2, 2e-4, 3
BINS_PER_BANDWIDTH = 10
# Ratios that differ from the median by a larger factor are no scale in any unit.
MOST_FACTOR = 1e4
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
    """

    sfm_per_metre: float
    width: float
    values: int

    def __str__(self) -> str:
        spread = 100 * self.width / self.sfm_per_metre
        known = f"{self.sfm_per_metre:.4f} units of the model per metre, spread {spread:.2f} %"
        return f"{known} over {counted(self.values, 'measurement')}"


def estimate_scale(ratios: np.ndarray) -> ScaleEstimate:
    """Return the mode of the ratios d*/d (eq. 7); warn if a second mode is nearly as high.

    With 10^6 ratios the relative error of the mode is below 10^-3, whatever the share of outliers, as long as
    the peak is denser than they are.

    Args:
        ratios: local scales [sfm / m], any shape; NaN, infinite, zero and negative ones are ignored.

    Raises:
        DigsError: no usable ratio.
    """
    values = np.asarray(ratios, dtype=np.float64).ravel()
    logs = np.sort(np.log(values[np.isfinite(values) & (values > 0)]))
    if not logs.size:
        raise DigsError(
            f"scale: {values.size} points of structure from motion fall on measured depth, none of them "
            "with a finite ratio above 0; check that the depth maps belong to the images, or use "
            "the poses of the capture (--poses capture)"
        )
    near = logs[np.abs(logs - np.median(logs)) <= np.log(MOST_FACTOR)]
    bandwidth = FIRST_BANDWIDTH
    for _ in range(REFINEMENTS):
        modes, _, deviation = _modes(near, bandwidth)
        first, last = np.searchsorted(near, [modes[0] - 3 * deviation, modes[0] + 3 * deviation])
        bandwidth = (4 / 5) ** (1 / 7) * deviation * max(int(last - first), 1) ** (-1 / 7)
        bandwidth = max(bandwidth, LEAST_BANDWIDTH)
    modes, heights, deviation = _modes(near, bandwidth)
    scale = float(np.exp(modes[0]))
    if len(modes) > 1 and heights[1] >= RIVAL_HEIGHT:
        logger.warning(
            "scale: a second mode at %.5g sfm per metre is %.0f %% as high as the one at %.5g that was used; "
            "check the depth unit of all frames and the masks",
            *(np.exp(modes[1]), 100 * heights[1], scale),
        )
    return ScaleEstimate(scale, float(deviation * scale), len(logs))


def _modes(logs: np.ndarray, bandwidth: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return logarithms and relative heights of the modes, the highest first, and its standard deviation."""
    from scipy.ndimage import gaussian_filter1d
    from scipy.signal import find_peaks

    step = bandwidth / BINS_PER_BANDWIDTH
    margin = 5 * BINS_PER_BANDWIDTH  # where the density falls to nothing
    bins = ((logs - logs[0]) / step).astype(int) + margin
    counts = np.bincount(bins, minlength=bins[-1] + margin + 1).astype(np.float64)
    at = logs[0] + step * (np.arange(len(counts)) - margin + 0.5)
    # Of the ratios, not of their logarithms: where noise is symmetric.
    density = gaussian_filter1d(counts, BINS_PER_BANDWIDTH, mode="constant") * np.exp(logs[0] - at)
    peaks, _ = find_peaks(density, prominence=MODE_PROMINENCE * density.max())
    peaks = peaks[np.argsort(-density[peaks], kind="stable")]
    low = np.flatnonzero(density < 0.5 * density[peaks[0]])
    right = int(np.searchsorted(low, peaks[0]))
    half_width = step * min(low[right] - peaks[0], peaks[0] - low[right - 1]) / HALF_WIDTH
    # The kernel's variance adds to that of the peak.
    deviation = np.sqrt(max(half_width**2 - bandwidth**2, LEAST_BANDWIDTH**2))
    return at[peaks], density[peaks] / density[peaks[0]], float(deviation)


def local_scales(sfm: SfmModel, frames: Sequence[Frame], config: InitConfig) -> np.ndarray:
    """Return the ratios d*/d [sfm / m] of all observations in ``frames`` (eq. 6), float64, NaN-free.

    As in the paper, depth is used where it was measured, inside the mask and away from depth jumps. If the
    masks leave fewer than `MIN_MASKED` ratios, the whole image is used.

    Args:
        sfm: the model in [sfm]; only its observations in ``frames`` are used.
        frames: frames with depth; held-out ones must not be among them.
        config: its edge filter.

    Raises:
        DigsError: the model knows none of the frames.
    """
    known = [frame for frame in frames if frame.name in sfm.names]
    if not known:
        raise DigsError(
            f"scale: structure from motion registered none of the {len(frames)} training frames; "
            f"it knows {len(sfm.names)} other names"
        )
    with (
        ThreadPoolExecutor(default_threads()) as pool,
        progress(len(known), "Estimating the scale", "frame") as bar,
    ):
        rows = []
        for row in pool.map(lambda frame: _ratios_of_view(sfm, frame, config), known):
            rows.append(row)
            bar.update()
    ratios, in_mask = np.concatenate(rows, axis=1)
    masked = ratios[in_mask > 0]
    if len(masked) >= MIN_MASKED:
        return masked
    logger.warning(
        "scale: %d observations inside the masks have depth, using all %d of the images",
        *(len(masked), len(ratios)),
    )
    return ratios


def _ratios_of_view(sfm: SfmModel, frame: Frame, config: InitConfig) -> np.ndarray:
    """Return the ratios, and whether each one lies in the mask, shape (2, n)."""
    from digs_warp.init.edges import smooth_depth  # its kernels are not needed to read a result

    depth = frame.load_depth()
    if config.edge_filter:
        depth = np.where(smooth_depth(depth), depth, np.float32(np.nan))
    points, rows, columns = observed_pixels(sfm, frame.name, depth.shape)
    _, sfm_depths = sfm.cameras[sfm.names.index(frame.name)].project(
        sfm.points.points_world[points]
    )
    measured = depth[rows, columns].astype(np.float64)
    usable = np.isfinite(measured) & (sfm_depths > 0)
    in_mask = np.ones(len(points), dtype=bool)
    if frame.has(Layer.MASK):
        in_mask = frame.load_mask()[rows, columns] > MASK_THRESHOLD
    return np.stack([sfm_depths[usable] / measured[usable], in_mask[usable]])


def observed_pixels(
    sfm: SfmModel, name: str, shape: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the points that a frame observes, and row and column of their pixels in an image of a shape."""
    index = sfm.names.index(name)
    mine = sfm.observations.cameras == index
    k = sfm.cameras[index].intrinsics
    height, width = shape
    px = sfm.observations.px[mine] * np.array([width / k.width, height / k.height])
    columns = np.clip(np.floor(px[:, 0]).astype(np.int64), 0, width - 1)
    rows = np.clip(np.floor(px[:, 1]).astype(np.int64), 0, height - 1)
    return sfm.observations.points[mine], rows, columns
