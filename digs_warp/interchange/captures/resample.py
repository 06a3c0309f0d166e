"""Bring depth onto the color camera's pixels, and take out lens distortion."""

import numpy as np

from digs_warp.camera import Intrinsics, pixel_centers


def resample_depth(depth: np.ndarray, source: Intrinsics, target: Intrinsics) -> np.ndarray:
    """Return the depth that ``target`` sees, (height, width): the nearest pixel of ``source``, never a mean.

    Both cameras have the same pose, so a ray keeps its planar depth; NaN where
    ``source`` does not look.
    """
    if source == target:
        return depth
    centers = pixel_centers(target.width, target.height)
    u = (centers[..., 0] - target.cx) / target.fx * source.fx + source.cx
    v = (centers[..., 1] - target.cy) / target.fy * source.fy + source.cy
    column, row = np.floor(u).astype(int), np.floor(v).astype(int)
    inside = (column >= 0) & (column < source.width) & (row >= 0) & (row < source.height)
    found = np.full((target.height, target.width), np.nan, np.float32)
    found[inside] = depth[row[inside], column[inside]]
    return found


def undistort(
    image: np.ndarray,
    depth: np.ndarray | None,
    mask: np.ndarray | None,
    k: Intrinsics,
    distortion: tuple[float, ...],
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Return image, depth and mask as a pinhole camera with the same ``k`` sees them.

    Args:
        image: (height, width, 3), uint8.
        depth: (height, width) [m], or None; takes the nearest pixel.
        mask: (height, width), uint8, or None.
        k: the camera.
        distortion: (k1, k2, p1, p2) or with more terms, as OpenCV has it.
    """
    import cv2

    matrix = k.matrix
    matrix[:2, 2] -= 0.5  # OpenCV counts pixel centers at integers
    across, down = cv2.initUndistortRectifyMap(
        matrix, np.array(distortion), np.eye(3), matrix, (k.width, k.height), cv2.CV_32FC1
    )
    image = cv2.remap(image, across, down, cv2.INTER_LINEAR)
    if depth is not None:
        depth = cv2.remap(
            depth, across, down, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=np.nan
        )  # fmt: skip
    if mask is not None:
        mask = cv2.remap(mask, across, down, cv2.INTER_LINEAR)
    return image, depth, mask
