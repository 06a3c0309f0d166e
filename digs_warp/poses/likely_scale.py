"""The scale of poses, from what depth and the given poses say of it."""

import numpy as np

# By how much the scale of depth is usually wrong: half of a percent with a drifted stereo camera.
DEPTH_SCALE = 0.005


def in_likely_scale(poses: np.ndarray, given: np.ndarray) -> np.ndarray:
    """Return the poses with their centers farther apart or closer together, as the given ones say.

    Refined poses have the scale of the depth. The given centers have one as well, which errors of single
    poses hardly change if there are many around an object, and which says nothing on a short arc. Each counts
    by the inverse of its variance.

    Args:
        poses: refined, (n, 4, 4).
        given: the same as they were, on which the refined ones lie as well as a rigid motion can.
    """
    middle = poses[:, :3, 3].mean(axis=0)
    own, before = poses[:, :3, 3] - middle, given[:, :3, 3] - given[:, :3, 3].mean(axis=0)
    extent, known = float((own**2).sum()), 3 * len(poses) - 7
    if known <= 0 or extent == 0:
        return poses
    larger = float((own * before).sum()) / extent - 1
    variance = float(((before - (1 + larger) * own) ** 2).sum()) / known / extent
    scaled = poses.copy()
    scaled[:, :3, 3] += larger * DEPTH_SCALE**2 / (DEPTH_SCALE**2 + variance) * own
    return scaled
