"""What matched features of two photographs say without depth: of their poses, and of their exposure.

Two photographs of the same things tell how the camera turned and in which direction it moved (the essential
matrix; Hartley and Zisserman, "Multiple View Geometry", section 9.6).
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.device.threads import default_threads
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.measure.sift import match_descriptors, sift
from digs_warp.poses.thresholds import LEAST_MATCHES

# Photographs are reduced to this width [px] or less; the strongest features of each are taken, up to this
# number. Brightness is a mean over squares of this side [px].
WIDTH, FEATURES, SQUARE = 640, 1000, 5

# A match is nearer than this share of the second nearest (Lowe, IJCV 2004, section 7.1), and agrees with a
# motion within this distance from the epipolar lines [px].
RATIO, WITHIN = 0.8, 2.0


@dataclass(frozen=True, eq=False)
class Features:
    """Of a photograph.

    Attributes:
        rays: x and y at depth 1, in the axes of the camera, (n, 2).
        descriptors: (n, 128), float32.
        brightness: 0 to 255, (n,).
        focal: of the reduced photograph [px].
    """

    rays: np.ndarray
    descriptors: np.ndarray
    brightness: np.ndarray
    focal: float


@dataclass(frozen=True, eq=False)
class PhotoMatches:
    """Matches of two photographs that agree on one motion.

    Attributes:
        x, y: at depth 1 in the axes of either camera, (n, 2).
        brightness: in the first and in the second, 0 to 255, (2, n).
        within: how far those of one motion are from its epipolar lines, at depth 1.
    """

    x: np.ndarray
    y: np.ndarray
    brightness: np.ndarray
    within: float


def matches_of_steps(frames: Sequence[Frame]) -> list[PhotoMatches | None]:
    """Return the matches of each photograph and the next; None where they are few."""
    with ThreadPoolExecutor(default_threads()) as pool:
        features = [*pool.map(_features_of, frames)]
        return [*pool.map(_matches, features, features[1:])]


def agreeing_shares(frames: Sequence[Frame]) -> list[float | None]:
    """Return for each step to the next frame the share of matches that agree with the poses; None: few."""

    def share(found: PhotoMatches | None, here: Frame, there: Frame) -> float | None:
        recorded = essential(here.camera, there.camera)
        if found is None or recorded is None:
            return None
        return float(np.mean(_distances(found.x, found.y, recorded) < 2 * found.within))

    return [*map(share, matches_of_steps(frames), frames, frames[1:])]


def _features_of(frame: Frame) -> Features:
    import cv2

    k = frame.camera.intrinsics
    factor = min(1.0, WIDTH / k.width)
    gray = cv2.cvtColor(frame.load_image(), cv2.COLOR_RGB2GRAY)
    if factor < 1.0:
        gray = cv2.resize(gray, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    px, descriptors = sift(gray, FEATURES)
    unknown = frame.load_unknown()
    if unknown is not None and len(px):
        columns, rows = (px / factor).astype(int).T
        kept = ~unknown[rows.clip(0, k.height - 1), columns.clip(0, k.width - 1)]
        px, descriptors = px[kept], descriptors[kept]
    columns, rows = px.astype(int).T.clip(0, [[gray.shape[1] - 1], [gray.shape[0] - 1]])
    brightness = cv2.blur(gray, (SQUARE, SQUARE))[rows, columns].astype(np.float64)
    rays = (px / factor - [k.cx, k.cy]) / [k.fx, k.fy]
    return Features(rays, descriptors, brightness, k.fx * factor)


def _matches(first: Features, second: Features) -> PhotoMatches | None:
    import cv2

    in_first, in_second = match_descriptors(first.descriptors, second.descriptors, RATIO)
    if len(in_first) < LEAST_MATCHES:
        return None
    x, y = first.rays[in_first], second.rays[in_second]
    within = WITHIN / min(first.focal, second.focal)
    cv2.setRNGSeed(0)
    free, _ = cv2.findEssentialMat(x, y, np.eye(3), cv2.RANSAC, 0.999, within)
    if free is None:
        return None
    sure = _distances(x, y, free[:3]) < within
    if np.count_nonzero(sure) < LEAST_MATCHES:
        return None
    brightness = np.stack([first.brightness[in_first], second.brightness[in_second]])
    return PhotoMatches(x[sure], y[sure], brightness[:, sure], within)


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
