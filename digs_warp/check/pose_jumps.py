"""Poses that jump in a recording without depth: matched features say that the camera moved otherwise.

Two photographs of the same things tell how the camera turned and in which direction it moved (the essential
matrix; Hartley and Zisserman, "Multiple View Geometry", section 9.6). Where the features of two neighbors
agree on some motion, but not on the recorded one, and those of other neighbors do, the poses jump. Two
photographs cannot tell how far the camera moved: a jump in just the direction of the step is not noticed.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from digs_warp.check.finding import Finding
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.parallel import default_threads
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import invert_rigid

# Photographs are reduced to this width [px] or less; the strongest features of each are taken, up to this
# number.
WIDTH, FEATURES = 640, 1000

# A match is nearer than this share of the second nearest (Lowe, IJCV 2004, section 7.1).
RATIO = 0.8

# Matches agree with a motion within this distance from the epipolar lines [px]; fewer prove nothing.
WITHIN, FEWEST = 2.0, 30

# A step is wrong where fewer than this share of the matches that agree with each other agree with the poses;
# that of most steps is above the other.
WRONG, USUAL = 0.3, 0.6

# Of longer recordings, only the first steps are looked at.
MOST_STEPS = 120

# More names than this make no list.
NAMED = 6


@dataclass(frozen=True, eq=False)
class Features:
    """Of a photograph.

    Attributes:
        rays: x and y at depth 1, in the axes of the camera, (n, 2).
        descriptors: (n, 128), float32.
        focal: of the reduced photograph [px].
    """

    rays: np.ndarray
    descriptors: np.ndarray
    focal: float


def pose_jumps(capture: Capture) -> list[Finding]:
    """Return a finding that names the steps; nothing with depth, which tells more, or without poses.

    Raises:
        DigsError: a file that cannot be read.
    """
    frames = capture.frames[: MOST_STEPS + 1]
    if not capture.knows_poses or any(frame.has(Layer.DEPTH) for frame in frames):
        return []
    shares = agreeing_shares(frames)
    told = [share for share in shares if share is not None]
    if len(told) < 3 or np.median(told) < USUAL:
        return []
    wrong = [i for i, share in enumerate(shares) if share is not None and share < WRONG]
    if not wrong:
        return []
    listed = ", ".join(f"{frames[i].name} and {frames[i + 1].name}" for i in wrong[:NAMED])
    what = (
        f"The poses jump between frames {listed}: what both photographs show says that the camera moved "
        "otherwise."
    )
    mend = (
        "Was tracking lost there, or are these two recordings in one? Reconstruct each part alone, or find "
        "the poses again with --poses sfm."
    )
    return [Finding("pose jump", what, mend)]


def agreeing_shares(frames: Sequence[Frame]) -> list[float | None]:
    """Return for each step to the next frame the share of matches that agree with the poses; None: few."""
    with ThreadPoolExecutor(default_threads()) as pool:
        features = [*pool.map(_features_of, frames)]
        cameras = [frame.camera for frame in frames]
        return [*pool.map(_share, features, features[1:], cameras, cameras[1:])]


def _features_of(frame: Frame) -> Features:
    import cv2

    image = frame.load_image()
    k = frame.camera.intrinsics
    factor = min(1.0, WIDTH / k.width)
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    if factor < 1.0:
        gray = cv2.resize(gray, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    keys, found = cv2.SIFT.create(nfeatures=FEATURES).detectAndCompute(gray, None)  # pyright: ignore[reportArgumentType, reportCallIssue]
    if not keys:
        return Features(np.zeros((0, 2)), np.zeros((0, 128), np.float32), k.fx * factor)
    # OpenCV puts integers at the centers of pixels.
    px = (np.array([key.pt for key in keys]) + 0.5) / factor
    return Features((px - [k.cx, k.cy]) / [k.fx, k.fy], found, k.fx * factor)


def _share(first: Features, second: Features, here: Camera, there: Camera) -> float | None:
    import cv2

    matches = _matched(first, second)
    if len(matches) < FEWEST:
        return None
    x, y = first.rays[matches[:, 0]], second.rays[matches[:, 1]]
    limit = WITHIN / min(first.focal, second.focal)
    cv2.setRNGSeed(0)
    free, _ = cv2.findEssentialMat(x, y, np.eye(3), cv2.RANSAC, 0.999, limit)
    if free is None:
        return None
    sure = _distances(x, y, free[:3]) < limit
    if np.count_nonzero(sure) < FEWEST:
        return None
    recorded = essential(here, there)
    if recorded is None:
        return None
    return float(np.mean(_distances(x[sure], y[sure], recorded) < 2 * limit))


def _matched(first: Features, second: Features) -> np.ndarray:
    """Return the numbers of features that are each other's nearest, (n, 2)."""
    import cv2

    if min(len(first.rays), len(second.rays)) < FEWEST:
        return np.zeros((0, 2), np.intp)
    found = cv2.BFMatcher().knnMatch(first.descriptors, second.descriptors, k=2)
    clear = [(a.queryIdx, a.trainIdx) for a, b in found if a.distance < RATIO * b.distance]
    numbers = np.array(clear, np.intp).reshape(-1, 2)
    _, once = np.unique(numbers[:, 1], return_index=True)
    return numbers[once]


def essential(first: Camera, second: Camera) -> np.ndarray | None:
    """Return the essential matrix of two poses, (3, 3); None where the camera did not move."""
    motion = invert_rigid(second.world_from_cam) @ first.world_from_cam
    shift = motion[:3, 3]
    length = float(np.linalg.norm(shift))
    if length == 0.0:
        return None
    x, y, z = shift / length
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ motion[:3, :3]


def _distances(x: np.ndarray, y: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return Sampson's distance of each match from an essential matrix, at depth 1, (n,)."""
    x, y = (np.column_stack([each, np.ones(len(each))]) for each in (x, y))
    there, here = x @ matrix.T, y @ matrix
    slope = (there[:, :2] ** 2).sum(axis=1) + (here[:, :2] ** 2).sum(axis=1)
    return np.abs((y * there).sum(axis=1)) / np.sqrt(np.maximum(slope, 1e-24))
