"""The right image of a pair, made from the left one and the true disparity."""

import numpy as np

from digs_warp.sim.sensor.filters import box_mean, sampled

# Steps larger than this are edges of objects: nothing is between the two sides [px].
EDGE = 1.0

# Points per pixel along a row, so that no gap opens where the right eye sees a surface wider.
FINE = 8

# Side of the windows whose variance tells texture from noise [px].
GRAIN_WINDOW = 5


def filled(disparity: np.ndarray) -> np.ndarray:
    """Return the disparity with each unknown value taken from the nearest pixel that has one."""
    from scipy.ndimage import distance_transform_edt

    indices = distance_transform_edt(
        np.isnan(disparity), return_distances=False, return_indices=True
    )
    return disparity[tuple(np.asarray(indices))]


def right_image(
    left: np.ndarray, disparity: np.ndarray, unseen: np.ndarray | None = None
) -> np.ndarray:
    """Return what the right eye sees, by the true disparity, (height, width, 3), uint8.

    Args:
        left: sRGB, (height, width, 3), uint8.
        disparity: true one of the left image [px], (height, width), without NaN.
        unseen: image to take from what the left eye does not see; None: what is beside it is repeated.
    """
    disparity = np.asarray(disparity, np.float32)
    seen = _seen_from_right(disparity)
    width = disparity.shape[1]
    rows, columns = (np.asarray(each) for each in np.indices(disparity.shape))
    hole = np.isnan(seen)
    shift = filled(seen) if unseen is None else np.where(hole, np.float32(0), seen)
    source = columns + shift
    image = sampled(left, source, rows)
    if unseen is not None:
        outside = hole | (source > width - 1)
        image[outside] = unseen[outside]
    return image


def _seen_from_right(disparity: np.ndarray) -> np.ndarray:
    """Return the disparity at each pixel of the right image, the nearest surface first, NaN: unseen."""
    height, width = disparity.shape
    nearest = np.full((height, width), -np.inf, np.float32)
    after = np.concatenate([disparity[:, 1:], disparity[:, -1:]], axis=1)
    joined = np.abs(after - disparity) < EDGE
    columns = np.arange(width, dtype=np.float32)
    for step in range(FINE):
        share = np.float32(step / FINE)
        value = np.where(joined, (1 - share) * disparity + share * after,
                         disparity if share < 0.5 else after)  # fmt: skip
        target = columns + share - value
        column = np.floor(target + 0.5).astype(int)
        rows, at = np.nonzero((column >= 0) & (column < width))
        # The surface continues to the pixel's center as it is here: half a pixel at most.
        slope = np.where(joined, after - disparity, 0)[rows, at]
        rest = (column - target)[rows, at] / (1 - np.minimum(slope, np.float32(0.9)))
        np.maximum.at(nearest, (rows, column[rows, at]), value[rows, at] + slope * rest)
    nearest[np.isinf(nearest)] = np.nan
    return nearest


def without_grain(image: np.ndarray, sigma: float) -> np.ndarray:
    """Return an image without noise of a known size, as far as that can be told from texture.

    Wiener's filter with the mean and the variance of small windows (Lee 1980): where these vary no more than
    the noise does, the mean is left.

    Args:
        image: sRGB, (height, width, 3), uint8.
        sigma: standard deviation of the noise of each channel [DN].
    """
    if sigma == 0:
        return image
    pixels = image.astype(np.float32)
    mean = box_mean(pixels, GRAIN_WINDOW)
    variance = np.maximum(box_mean(pixels**2, GRAIN_WINDOW) - mean**2, 1e-6)
    texture = np.maximum(variance - np.float32(sigma**2), 0) / variance
    return np.clip(np.rint(mean + texture * (pixels - mean)), 0, 255).astype(np.uint8)
