"""Image metrics in float64 NumPy. Images have values in 0..1, shape (height, width, 3)."""

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.measure.ssim import C1, C2, window_weights

# Identical images would give infinity, which JSON cannot store; 8-bit rounding alone gives 59 dB.
MAX_PSNR = 100.0


def psnr(image: np.ndarray, target: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Return the peak signal-to-noise ratio [dB], at most 100; over ``mask`` (bool) if given.

    An empty mask gives NaN.
    """
    check_shape("image", image, target.shape)
    squared = (np.asarray(image, np.float64) - target) ** 2
    if mask is not None:
        squared = squared[mask]
    if squared.size == 0:
        return float("nan")
    return float(min(MAX_PSNR, -10.0 * np.log10(max(squared.mean(), 10 ** (-MAX_PSNR / 10)))))


def ssim_map(image: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return SSIM per pixel and channel, same shape: 11x11 Gaussian window, zero padding.

    `digs_warp.measure.ssim` documents the formula; this is its plain float64 version.
    """
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


def mean_over(values: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Return the mean of ``values``, over the pixels of ``mask`` (bool, (height, width)) if given.

    An empty mask gives NaN.
    """
    if mask is not None:
        values = values[mask]
    return float(values.mean()) if values.size else float("nan")
