"""SIFT features of a gray image, and matches between the features of two images."""

import numpy as np


def sift(gray: np.ndarray, most: int, **limits: float) -> tuple[np.ndarray, np.ndarray]:
    """Return places and descriptors of the strongest features.

    Args:
        gray: image, (height, width), uint8.
        most: number of features.
        limits: of OpenCV: ``contrastThreshold``, ``edgeThreshold``.

    Returns:
        Places [px], pixel centers at +0.5, (n, 2), float64; descriptors of length 1, (n, 128), float32,
        SIFT's as square roots (Arandjelovic and Zisserman, CVPR 2012).
    """
    import cv2

    keys, found = cv2.SIFT.create(nfeatures=most, **limits).detectAndCompute(gray, None)  # pyright: ignore[reportArgumentType, reportCallIssue]
    if not keys:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32)
    # OpenCV puts integers at the centers of pixels.
    px = np.array([key.pt for key in keys]) + 0.5
    shares = found / np.maximum(found.sum(axis=1, keepdims=True), 1e-6)
    return px, np.sqrt(shares).astype(np.float32)


def match_descriptors(
    first: np.ndarray, second: np.ndarray, ratio: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of features that are each other's nearest, (n,) of either image.

    Args:
        first: descriptors of an image, as of `sift`.
        second: of the other one.
        ratio: the nearest is nearer than this share of the second nearest (Lowe, IJCV 2004, section 7.1).
    """
    if not len(first) or len(second) < 2:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    # Descriptors of length 1: the larger the product, the nearer.
    products = first @ second.T
    order = np.argpartition(-products, 1, axis=1)[:, :2]
    two = np.take_along_axis(products, order, axis=1)
    best = np.where(two[:, 0] >= two[:, 1], order[:, 0], order[:, 1])
    distances = np.sqrt(np.maximum(2 - 2 * two, 0.0))
    clear = distances.min(axis=1) < ratio * distances.max(axis=1)
    mutual = products.argmax(axis=0)[best] == np.arange(len(first))
    kept = np.flatnonzero(clear & mutual)
    return kept, best[kept]
