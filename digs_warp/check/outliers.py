"""Outliers: frames whose depth or features contradict the others, and places where a recording breaks in two.

Depth of neighboring frames is compared at the recorded poses. A frame that none agrees with, between frames
that agree with each other, has a broken pose, or depth of another moment. Where frames agree on either side
but not across, two recordings are in one, or the poses jump: tracking was lost and found again.

Without depth, two photographs of the same things tell how the camera turned and in which direction it moved
(the essential matrix; Hartley and Zisserman, "Multiple View Geometry", section 9.6). Where the features of
two neighbors agree on some motion, but not on the recorded one, and those of other neighbors do, the poses
jump. Two photographs cannot tell how far the camera moved: a jump in just the direction of the step is not
noticed.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from digs_warp.check import thresholds as limits
from digs_warp.check.evidence import Evidence, same_depth_share, shared_points
from digs_warp.check.thresholds import Threshold
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.threads import default_threads
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.measure.sift import match_descriptors, sift
from digs_warp.measure.thumbnails import SmallFrame, small_frames
from digs_warp.words import counted, first_few

# Longer recordings are thinned evenly; frames up to this far apart are compared.
MOST_FRAMES, REACH = 300, 2

# Photographs are reduced to this width [px] or less; the strongest features of each are taken, up to this
# number. Of longer recordings, only the first steps are looked at.
WIDTH, FEATURES, MOST_STEPS = 640, 1000, 120

# A match is nearer than this share of the second nearest (Lowe, IJCV 2004, section 7.1), and agrees with a
# motion within this distance from the epipolar lines [px].
RATIO, WITHIN = 0.8, 2.0


@dataclass(frozen=True)
class Links:
    """How well frames agree with those up to `REACH` after them.

    Attributes:
        names: of the frames.
        shares: 0 to 1; None: nothing in common.
    """

    names: tuple[str, ...]
    shares: dict[tuple[int, int], float | None]

    @cached_property
    def typical(self) -> float:
        """Median of neighboring frames; 0 if there are none."""
        found = [s for (a, b), s in self.shares.items() if s is not None and b == a + 1]
        return float(np.median(found)) if found else 0.0

    def between(self, first: int, second: int) -> float | None:
        """Return the agreement of two frames."""
        return self.shares.get((min(first, second), max(first, second)))

    def contradict(self, first: int, second: int, below: float) -> bool:
        """Whether two frames agree less than this share of what is typical: they measure different things."""
        share = self.between(first, second)
        return share is not None and share < below * self.typical

    def agree(self, first: int, second: int) -> bool:
        """Whether two frames measure the same."""
        share = self.between(first, second)
        return share is not None and share > limits.AGREEING_SHARE * self.typical


def links(evidence: Evidence) -> Links | None:
    """Return how the frames agree; None without poses or depth, or where single frames are lost in noise."""
    frames = evidence.capture.frames
    if not evidence.knows_poses or len(frames) < 4:
        return None
    last = len(frames) - 1
    numbers = np.unique(np.linspace(0, last, min(MOST_FRAMES, last + 1)).round().astype(int))
    small = small_frames(frames, numbers.tolist())
    thumbnails = [*small.values()]
    pairs = [(a, b) for b in range(len(small)) for a in range(max(0, b - REACH), b)]
    shares = {(a, b): _share(thumbnails[a], thumbnails[b]) for a, b in pairs}
    found = Links(tuple(frames[number].name for number in small), shares)
    return found if found.typical >= limits.LEAST_TYPICAL_AGREEMENT else None


def _share(first: SmallFrame, second: SmallFrame) -> float | None:
    """Return the share of points in common at the same depth in both; None: hardly any in common."""
    seen = [shared_points(first, second), shared_points(second, first)]
    overlap = limits.OUTLIER_OVERLAP * sum(each.looked_at for each in seen)
    if sum(len(each.depth) for each in seen) < max(limits.LEAST_POINTS_IN_COMMON, overlap):
        return None
    return same_depth_share(seen)


def outlier_frames(evidence: Evidence, below: Threshold) -> dict[str, Any] | None:
    """Find frames that contradict all around them, where those agree with each other."""
    found = evidence.once(links)
    if found is None or not (outliers := alone(found, below)):
        return None
    names = first_few([found.names[i] for i in outliers])
    return {"frames": counted(len(outliers), "frame"), "count": len(found.names), "names": names}


def alone(found: Links, below: float) -> list[int]:
    """Return the numbers of those frames."""
    outliers, count = [], len(found.names)
    for i in range(count):
        around = [j for j in range(i - REACH, i + REACH + 1) if j != i and 0 <= j < count]
        against = [j for j in around if found.contradict(i, j, below)]
        together = any(found.agree(a, b) for a in against for b in against if a < b)
        if len(against) >= 2 and together and not any(found.agree(i, j) for j in around):
            outliers.append(i)
    return outliers


def breaks(evidence: Evidence, below: Threshold) -> dict[str, Any] | None:
    """Find frames after which nothing agrees with what was before, while each side agrees in itself."""
    found = evidence.once(links)
    if found is None:
        return None
    outliers, places = alone(found, below), []
    for i in range(1, len(found.names) - 2):
        across = [(i, i + 1), (i - 1, i + 1), (i, i + 2)]
        sides = found.agree(i - 1, i) and found.agree(i + 1, i + 2)
        against = sum(found.contradict(*pair, below) for pair in across)
        is_break = sides and against >= 2 and not any(found.agree(*pair) for pair in across)
        if is_break and not {i, i + 1} & set(outliers):
            places.append(f"{found.names[i]} and {found.names[i + 1]}")
    return {"places": first_few(places)} if places else None


def pose_jumps(evidence: Evidence, wrong: Threshold) -> dict[str, Any] | None:
    """Find steps where less than this share of the matches that agree with each other agree with the poses.

    Nothing with depth, which tells more, or without poses.
    """
    frames = evidence.capture.frames[: MOST_STEPS + 1]
    if not evidence.knows_poses or any(frame.has(Layer.DEPTH) for frame in frames):
        return None
    shares = agreeing_shares(frames)
    valid = [share for share in shares if share is not None]
    if len(valid) < 3 or np.median(valid) < limits.USUAL_MATCH_SHARE:
        return None
    steps = [i for i, share in enumerate(shares) if share is not None and share < wrong]
    places = [f"{frames[i].name} and {frames[i + 1].name}" for i in steps]
    return {"places": first_few(places)} if places else None


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


def agreeing_shares(frames: Sequence[Frame]) -> list[float | None]:
    """Return for each step to the next frame the share of matches that agree with the poses; None: few."""
    with ThreadPoolExecutor(default_threads()) as pool:
        features = [*pool.map(_features_of, frames)]
        cameras = [frame.camera for frame in frames]
        return [*pool.map(_match_share, features, features[1:], cameras, cameras[1:])]


def _features_of(frame: Frame) -> Features:
    import cv2

    image = frame.load_image()
    k = frame.camera.intrinsics
    factor = min(1.0, WIDTH / k.width)
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    if factor < 1.0:
        gray = cv2.resize(gray, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    px, descriptors = sift(gray, FEATURES)
    px = px / factor
    return Features((px - [k.cx, k.cy]) / [k.fx, k.fy], descriptors, k.fx * factor)


def _match_share(first: Features, second: Features, here: Camera, there: Camera) -> float | None:
    import cv2

    in_first, in_second = match_descriptors(first.descriptors, second.descriptors, RATIO)
    if len(in_first) < limits.LEAST_MATCHES:
        return None
    x, y = first.rays[in_first], second.rays[in_second]
    limit = WITHIN / min(first.focal, second.focal)
    cv2.setRNGSeed(0)
    free, _ = cv2.findEssentialMat(x, y, np.eye(3), cv2.RANSAC, 0.999, limit)
    if free is None:
        return None
    sure = _distances(x, y, free[:3]) < limit
    if np.count_nonzero(sure) < limits.LEAST_MATCHES:
        return None
    recorded = essential(here, there)
    if recorded is None:
        return None
    return float(np.mean(_distances(x[sure], y[sure], recorded) < 2 * limit))


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
