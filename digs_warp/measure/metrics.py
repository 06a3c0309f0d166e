"""Image metrics in float64 NumPy. Images have values in 0..1, shape (height, width, 3)."""

from collections.abc import Sequence

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.measure.ssim import C1, C2, REACH, window_weights

_Part = tuple[slice, slice]

# Identical images would give infinity, which JSON cannot store; 8-bit rounding alone gives 59 dB.
MAX_PSNR = 100.0


def psnr(image: np.ndarray, target: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Return the peak signal-to-noise ratio [dB], at most 100; over ``mask`` (bool) if given.

    An empty mask gives NaN.
    """
    check_shape("image", image, target.shape)
    if mask is not None:
        squared = (np.asarray(image[mask], np.float64) - target[mask]) ** 2
    else:
        squared = np.zeros(image.shape)
        part = _where_they_differ(image, target)
        squared[part] = (np.asarray(image[part], np.float64) - target[part]) ** 2
    if squared.size == 0:
        return float("nan")
    return float(min(MAX_PSNR, -10.0 * np.log10(max(squared.mean(), 10 ** (-MAX_PSNR / 10)))))


def ssim_map(image: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return SSIM per pixel and channel, same shape: 11x11 Gaussian window, zero padding.

    `digs_warp.measure.ssim` documents the formula; this is its plain float64 version.
    """
    # Where the windows see no difference, the similarity is exactly 1; that is most of an object on white.
    part = _where_they_differ(image, target)
    similarity = np.ones(image.shape)
    if image[part].size:
        found, seen = (_grown(part, by, image.shape) for by in (REACH, 2 * REACH))
        within = _inside(found, seen)
        similarity[found] = _similarity(image[seen], target[seen])[within]
    return similarity


def _similarity(image: np.ndarray, target: np.ndarray) -> np.ndarray:
    import cv2

    weights = np.array(window_weights())

    def blur(values: np.ndarray) -> np.ndarray:
        blurred = cv2.sepFilter2D(values, -1, weights, weights, borderType=cv2.BORDER_CONSTANT)
        return blurred.reshape(values.shape)  # OpenCV drops a last axis of length 1

    x, y = np.asarray(image, np.float64), np.asarray(target, np.float64)
    mean_x, mean_y = blur(x), blur(y)
    var_x = blur(x * x) - mean_x**2
    var_y = blur(y * y) - mean_y**2
    covariance = blur(x * y) - mean_x * mean_y
    numerator = (2 * mean_x * mean_y + C1) * (2 * covariance + C2)
    return numerator / ((mean_x**2 + mean_y**2 + C1) * (var_x + var_y + C2))


def _where_they_differ(image: np.ndarray, target: np.ndarray) -> _Part:
    """Return rows and columns of the smallest box outside of which two images are equal."""
    # Each reduction goes over whole rows: one over the few channels alone takes ten times as long.
    unequal = np.not_equal(image, target)
    rows = np.flatnonzero(np.any(unequal.reshape(len(unequal), -1), axis=1))
    columns = np.flatnonzero(np.any(np.any(unequal, axis=0), axis=1))
    if not len(rows):
        return slice(0, 0), slice(0, 0)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def _grown(part: _Part, by: int, shape: Sequence[int]) -> _Part:
    """Return a part of an image, larger by some pixels on each side, as far as the image goes."""
    rows, columns = (
        slice(max(0, each.start - by), min(size, each.stop + by))
        for each, size in zip(part, shape[:2], strict=True)
    )
    return rows, columns


def _inside(part: _Part, outer: _Part) -> _Part:
    """Return where a part lies in a larger one."""
    rows, columns = (
        slice(each.start - start, each.stop - start)
        for each, start in zip(part, (side.start for side in outer), strict=True)
    )
    return rows, columns


def mean_over(values: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Return the mean of ``values``, over the pixels of ``mask`` (bool, (height, width)) if given.

    An empty mask gives NaN.
    """
    if mask is not None:
        values = values[mask]
    return float(values.mean()) if values.size else float("nan")
