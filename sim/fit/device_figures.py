"""Figures that tell depth cameras apart: roughness, what changes between frames, holes.

The same figures of any recording, real or simulated, so that one can be set beside the other. They need no
true depth, only frames of disparity or depth.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from digs_warp.sim.fit.estimate import UNKNOWN, Estimate
from digs_warp.sim.sensor.filters import patch_areas
from digs_warp.sim.sensor.noise_field import octave_normal

# Sides of the windows [px].
WINDOWS = (8, 16, 32, 64)

# Windows with values farther than this from their plane show a step [px].
STEP = 1.5

# Standard error of a median over that of a mean, of normal values.
OF_MEDIAN = 1.25


@dataclass(frozen=True)
class Roughness:
    """Of the windows of one size that show a plane.

    Attributes:
        residual: root mean square distance of the disparity from the plane of each window [px], (n,).
        disparity: mean of each window [px], (n,).
    """

    residual: np.ndarray
    disparity: np.ndarray

    def median(self, least: float = 0.0, most: float = np.inf) -> float:
        """Return the median residual of windows with a disparity between two [px]; NaN: there are none."""
        near = (self.disparity >= least) & (self.disparity < most)
        return float(np.median(self.residual[near])) if near.any() else np.nan

    @property
    def estimate(self) -> Estimate:
        """The median with its standard error, windows taken for independent [px]."""
        if len(self.residual) < 2:
            return UNKNOWN
        error = OF_MEDIAN * self.residual.std() / np.sqrt(len(self.residual))
        return Estimate(self.median(), float(error))


def roughness(disparity: np.ndarray, size: int) -> Roughness:
    """Return how rough planes are in square windows beside each other, but those with holes or steps.

    Args:
        disparity: [px], (height, width) or (frames, height, width), NaN where there is none.
        size: side of the windows [px].
    """
    height, width = (side // size for side in disparity.shape[-2:])
    cut = disparity[..., : height * size, : width * size].astype(np.float64)
    windows = cut.reshape(-1, height, size, width, size).swapaxes(2, 3).reshape(-1, size * size)
    windows = windows[np.isfinite(windows).all(axis=1)]
    row, column = (place.reshape(-1) for place in np.indices((size, size)))
    plane = np.linalg.qr(np.stack([np.ones(size * size), row, column], axis=1))[0]
    rest = windows - (windows @ plane) @ plane.T
    flat = np.abs(rest).max(axis=1, initial=0.0) <= STEP
    residual = np.sqrt(np.mean(rest[flat] ** 2, axis=1))
    return Roughness(residual, windows[flat].mean(axis=1))


# Correlations that are tried [px], and the field that shows what each looks like.
TRIED = (0.0, *(1.5 * 2 ** (step / 3) for step in range(19)))
SHOWN = (256, 384)


def correlation_of(medians: Sequence[float]) -> float:
    """Return the correlation of `octave_normal` that is as rough, in proportion [px]; 0: white noise.

    Args:
        medians: residuals in `WINDOWS` [px], NaN where unknown; of fewer than three, NaN comes back.
    """
    curve = np.log(np.asarray(medians, np.float64))
    known = np.isfinite(curve)
    if known.sum() < 3:
        return np.nan
    spread = [np.std((curve - own)[known]) for own in _curves()]
    return TRIED[int(np.argmin(spread))]


@cache
def _curves() -> list[np.ndarray]:
    """Return the logarithms of the residuals of each correlation in `TRIED`."""
    curves = []
    for correlation in TRIED:
        rng = np.random.Generator(np.random.SFC64(0))
        field = octave_normal(rng, SHOWN, correlation)
        # Far below a step, so that no window is left out.
        curves.append(np.log([roughness(0.01 * field, size).median() for size in WINDOWS]))
    return curves


def temporal_share(residual: np.ndarray) -> float:
    """Return the share of the variance that changes between frames of a camera at rest, 0 to 1.

    Args:
        residual: distance from what is there, in any unit, (frames, height, width), NaN where unknown.
    """
    always = residual[:, np.isfinite(residual).all(axis=0)].astype(np.float64)
    return float(always.var(axis=0, ddof=1).mean() / np.mean(always**2))


# Holes of up to this many pixels are small.
SMALL = 3


@dataclass(frozen=True)
class Holes:
    """Of a frame.

    Attributes:
        share: of the pixels, 0 to 1.
        per_10000: connected holes in 10,000 pixels.
        small: share of the hole area in holes of up to three pixels, 0 to 1; NaN: there are none.
    """

    share: float
    per_10000: float
    small: float


def holes(disparity: np.ndarray, inside: np.ndarray | None = None) -> Holes:
    """Return the holes of a frame ``inside`` a mask, both (height, width); disparity is NaN in holes."""
    missing = np.isnan(disparity) if inside is None else np.isnan(disparity) & inside
    count = missing.size if inside is None else max(np.count_nonzero(inside), 1)
    sizes = patch_areas(missing)
    small = float(sizes[sizes <= SMALL].sum() / sizes.sum()) if len(sizes) else np.nan
    return Holes(float(sizes.sum() / count), 1e4 * len(sizes) / count, small)
