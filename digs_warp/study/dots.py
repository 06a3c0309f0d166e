"""Projected dots in an infrared image, and what a matcher makes of the surface that they are on."""

from dataclasses import dataclass

import numpy as np

from digs_warp.sim.sensor.color.encoding import decode

# Dots are maxima of a difference of Gaussians of these standard deviations [px], at least this high [DN].
INNER, OUTER = 1.2, 3.6
LEAST = 6.0

# The background of a dot is the median of a ring [px]; beyond it, another dot may begin.
RING = (3.5, 5.5)

# Pixels that are brighter than this share of the top tell the size of a dot, within two pixels of it.
BRIGHT, NEAR = 0.2, 2

# Image noise is measured outside squares of this side round the dots [px].
CLEAR = 9

# Errors that count as wrong, not noisy [px].
WRONG = 1.0


@dataclass(frozen=True)
class DotStatistics:
    """The dots of a region.

    Attributes:
        area: pixels per dot.
        nearest: median distance to the nearest dot, over the square root of ``area``.
        sigma: median standard deviation of a dot's spot [px].
        brightness: median of the tops above their backgrounds, linear, 1 is white.
        spread: robust standard deviation of the logarithm of ``brightness``.
        noise: standard deviation of the image noise between the dots [DN].
    """

    area: float
    nearest: float
    sigma: float
    brightness: float
    spread: float
    noise: float


def measure_dots(image: np.ndarray, region: np.ndarray) -> DotStatistics:
    """Find the dots of a region.

    Args:
        image: gray, (height, width), uint8.
        region: where to look, (height, width), bool; at least ten dots.
    """
    import cv2
    from scipy.spatial import KDTree  # pyright: ignore[reportAttributeAccessIssue]

    gray = image.astype(np.float32)
    blurred = [cv2.GaussianBlur(gray, (0, 0), sigma) for sigma in (INNER, OUTER)]
    contrast = blurred[0] - blurred[1]
    is_top = (contrast == cv2.dilate(contrast, np.ones((5, 5)))) & (contrast > LEAST) & region
    reach = int(np.ceil(RING[1]))
    is_top[:reach], is_top[-reach:], is_top[:, :reach], is_top[:, -reach:] = (False,) * 4
    places = np.argwhere(is_top)
    tops, backgrounds, sigmas = np.array([_fit(gray, *place) for place in places]).T
    light = decode(np.clip(np.rint(tops), 0, 255).astype(np.uint8))
    light = light - decode(np.clip(np.rint(backgrounds), 0, 255).astype(np.uint8))
    near_dots = cv2.dilate(is_top.view(np.uint8), np.ones((CLEAR, CLEAR))).view(bool)
    area = np.count_nonzero(region) / len(places)
    nearest = KDTree(places).query(places, k=2)[0][:, 1]
    return DotStatistics(
        area=area,
        nearest=float(np.median(nearest) / np.sqrt(area)),
        sigma=float(np.nanmedian(sigmas)),
        brightness=float(np.median(light)),
        spread=robust_sigma(np.log(np.maximum(light, 1e-4))),
        noise=_image_noise(gray, region & ~near_dots),
    )


def _fit(gray: np.ndarray, row: int, column: int) -> tuple[float, float, float]:
    """Return top and background [DN] and standard deviation [px] of a dot: a Gaussian on the background."""
    reach = int(np.ceil(RING[1]))
    window = gray[row - reach : row + reach + 1, column - reach : column + reach + 1]
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(np.float64)
    distance = np.hypot(x, y)
    background = float(np.median(window[(distance > RING[0]) & (distance < RING[1])]))
    height = window - background
    use = (np.maximum(abs(x), abs(y)) <= NEAR) & (height > BRIGHT * height[reach, reach])
    # The logarithm of a Gaussian is a paraboloid; brighter pixels know it better.
    weight = height[use]
    terms = np.stack([np.ones(weight.size), x[use], y[use], x[use] ** 2 + y[use] ** 2], axis=1)
    fit = np.linalg.lstsq(terms * weight[:, None], np.log(weight) * weight, rcond=None)[0]
    if fit[3] >= 0:
        return background + height[reach, reach], background, float("nan")
    top = np.exp(fit[0] - (fit[1] ** 2 + fit[2] ** 2) / (4 * fit[3]))
    return background + float(top), background, float(np.sqrt(-0.5 / fit[3]))


def _image_noise(gray: np.ndarray, between: np.ndarray) -> float:
    """Return the noise by second differences across rows and columns (Immerkaer 1996)."""
    across = gray[:, :-2] - 2 * gray[:, 1:-1] + gray[:, 2:]
    both = across[:-2] - 2 * across[1:-1] + across[2:]
    return float(np.sqrt(np.pi / 2) * np.abs(both[between[1:-1, 1:-1]]).mean() / 6)


def robust_sigma(values: np.ndarray) -> float:
    """Return the standard deviation of values as their median distance to the median tells it."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


@dataclass(frozen=True)
class PlaneFit:
    """Disparity of a plane in an image.

    Attributes:
        plane: disparity = plane @ (1, column, row) [px], pixel centers at whole numbers.
        fill: share of the region with disparity.
        wrong: share of that farther than a pixel from the plane.
        rms: of the others [px].
        correlation: of the others with those two and eight pixels to the right.
    """

    plane: np.ndarray
    fill: float
    wrong: float
    rms: float
    correlation: tuple[float, float]


def fit_plane(disparity: np.ndarray, region: np.ndarray) -> PlaneFit:
    """Fit a plane to the disparity of a region, robustly.

    Args:
        disparity: [px], (height, width), NaN where there is none.
        region: (height, width), bool.
    """
    known = region & np.isfinite(disparity)
    rows, columns = np.nonzero(known)
    terms = np.stack([np.ones(len(rows)), columns, rows], axis=1)
    values = disparity[known].astype(np.float64)
    weight = np.ones(len(values))
    plane = np.zeros(3)
    for _ in range(10):  # least absolute deviations by weighted least squares
        plane = np.linalg.lstsq(terms * weight[:, None], values * weight, rcond=None)[0]
        weight = 1 / np.sqrt(np.maximum(np.abs(values - terms @ plane), 0.05))
    residual = np.full(disparity.shape, np.nan)
    residual[known] = values - terms @ plane
    wrong = np.abs(residual) > WRONG
    residual[wrong] = np.nan
    variance = np.nanmean(residual**2)
    correlation = [
        float(np.nanmean(residual[:, :-lag] * residual[:, lag:]) / variance) for lag in (2, 8)
    ]
    return PlaneFit(
        plane=plane,
        fill=float(known.sum() / region.sum()),
        wrong=float(wrong.sum() / known.sum()),
        rms=float(np.sqrt(variance)),
        correlation=(correlation[0], correlation[1]),
    )
