"""How a camera has to turn so that what it draws lies over its photograph.

A turn moves an image by a homography, whatever the depth of what it shows, so image and photograph alone tell
it (Lucas and Kanade, "An iterative image registration technique", IJCAI 1981). With the ray (x, y, 1) of a
pixel, a turn w [rad] in the camera's axes moves its content by

    du = fx (x y wx - (1 + x^2) wy + y wz),   dv = fy ((1 + y^2) wx - x y wy - x wz)

and changes the image by -(I_u du + I_v dv). The gradient is the mean of both images', which converges from
farther (Malis, "Improving vision-based control using efficient second-order minimization", ICRA 2004).
"""

import numpy as np

from digs_warp.camera import Intrinsics
from digs_warp.geometry import PixelBox

# Differences of color above this count by their size, as in L1, below by their square.
SMALL_DIFFERENCE = 0.03
# No step moves the image by more of its pixels: beyond, its gradient tells nothing.
LARGEST_STEP = 2.0
# Standard deviation of what is expected of a turn [pixel of the image]: holds what nothing is seen of.
EXPECTED = 3.0
# Fewer pixels than this tell no turn.
LEAST_PIXELS = 64


def turn_between(
    image: np.ndarray, photograph: np.ndarray, k: Intrinsics, box: PixelBox, pool: int
) -> np.ndarray:
    """Return the turn [rad] of the camera, (3,), by which its image lies better over the photograph.

    Args:
        image: what it draws, sRGB in 0..1, (height, width, 3), inside of ``box``.
        photograph: the same of the photograph.
        k: of the whole image.
        box: where in the whole image both lie [px].
        pool: width of the blocks of pixels that are averaged first; wider ones converge from farther.
    """
    height, width = image.shape[0] // pool, image.shape[1] // pool
    if min(height, width) < 2 or height * width < LEAST_PIXELS:
        return np.zeros(3)
    first, second = pooled(image, pool), pooled(photograph, pool)
    rows, columns = np.indices(first.shape[:2])
    x = (box[0] + (columns + 0.5) * pool - k.cx) / k.fx
    y = (box[1] + (rows + 0.5) * pool - k.cy) / k.fy
    mean = (first + second) / 2
    down, right = np.gradient(mean, pool, axis=(0, 1))
    flows = [  # of the content, for a turn about each axis
        (k.fx * x * y, k.fy * (1 + y * y)),
        (-k.fx * (1 + x * x), -k.fy * x * y),
        (k.fx * y, -k.fy * x),
    ]
    slopes = [
        -(right * np.asarray(du)[..., None] + down * np.asarray(dv)[..., None]).ravel()
        for du, dv in flows
    ]
    jacobian = np.stack(slopes, axis=1)
    difference = (first - second).ravel()
    weights = 1 / np.maximum(np.abs(difference), SMALL_DIFFERENCE)
    matrix = jacobian.T @ (jacobian * weights[:, None])
    matrix += np.eye(3) * (k.fx / (EXPECTED * pool)) ** 2
    turn = -np.linalg.solve(matrix, jacobian.T @ (weights * difference))
    largest = LARGEST_STEP * pool / k.fx
    return turn * min(1.0, largest / max(float(np.linalg.norm(turn)), 1e-12))


def pooled(image: np.ndarray, size: int) -> np.ndarray:
    """Return means of blocks of ``size`` x ``size`` pixels; an incomplete last row or column drops out."""
    height, width = image.shape[0] // size, image.shape[1] // size
    blocks = image[: height * size, : width * size].reshape(height, size, width, size, -1)
    return blocks.mean(axis=(1, 3))
