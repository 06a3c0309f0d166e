"""Depth of a recorded stereo pair that came without: semi-global matching of its rectified images.

Cameras such as the ZED compute depth from the two images that they record. Where only the images were kept,
such a search makes it again, and says how far each match can be trusted.
"""

import numpy as np

from digs_warp.geometry.camera import Intrinsics

# What is nearer than this many times the distance between the eyes gets no depth: the search has to end.
NEAREST_BASELINES = 4.0

# A disparity below it [px] tells little: an error of a quarter of a pixel moves the depth by a fourth.
LEAST_DISPARITY = 1.0

# Width of the square that is compared [px].
WINDOW = 5


def matched_depth(
    left: np.ndarray, right: np.ndarray, k: Intrinsics, baseline: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return depth and confidence of the left image of a rectified pair.

    Args:
        left: sRGB, (height, width, 3), uint8.
        right: of the same camera, ``baseline`` metres to the right.
        k: camera of both images.
        baseline: distance between the eyes [m].

    Returns:
        Planar depth [m], (height, width), float32, NaN where nothing matches; and the confidence in each
        match, 0 to 255, (height, width), uint8.
    """
    from digs_warp.data.images import to_uint8
    from digs_warp.sim.sensor.filters import gray_of
    from digs_warp.sim.sensor.guided.confidence import confidence_in_matches
    from digs_warp.sim.sensor.matcher import match

    grays = gray_of(left), gray_of(right)
    disparities = search_end(k)
    found = match(*grays, disparities, WINDOW)
    confidence = confidence_in_matches(*grays, found, disparities, WINDOW)
    found[~(found >= LEAST_DISPARITY)] = np.nan
    depth = np.float32(k.fx * baseline) / found
    return depth, to_uint8(np.where(np.isfinite(depth), confidence, 0.0))


def search_end(k: Intrinsics) -> int:
    """Return the end of the search range [px], exclusive: a multiple of 16."""
    end = min(k.fx / NEAREST_BASELINES, float(k.width))
    return 16 * max(1, int(np.ceil(end / 16)))
