"""Wrong units, focal lengths, pose conventions and times: what would make depth, poses and images agree.

Each explanation is tried: the one with which neighboring frames agree best is what is wrong, if they agree
much better with it than as recorded.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from digs_warp.check import thresholds as limits
from digs_warp.check.evidence import Agreement, Evidence, agreement
from digs_warp.data.viewpoints import spread
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL, invert_rigid
from digs_warp.measure.thumbnails import WIDTH, SmallFrame, front_points, green_means, thumbnails

# Depth cameras measure medians in this range [m].
NEAREST, FARTHEST = 0.01, 100.0

# Factor that corrects the depth -> what is wrong then. A wrong unit of the poses looks the same.
UNITS = {
    1e-3: "the depth is in millimetres (or the poses are in kilometres)",
    1e-2: "the depth is in centimetres",
    2e-1: "the depth is in TUM's units, 5000 per metre, but was read as millimetres",
    5.0: "the depth is in millimetres, but was read in TUM's units, 5000 per metre",
    1e-1: "the depth is in tenths of its unit, such as 0.1 mm in 16-bit images",
    0.0254: "the depth is in inches",
    0.3048: "the depth is in feet",
    1e1: "the depth is 10 times too small",
    1 / 0.3048: "the poses are in feet",
    1 / 0.0254: "the poses are in inches",
    1e2: "the poses are in centimetres",
    1e3: "the poses are in millimetres (or the depth is in kilometres)",
}

# Other factors that correct the depth: poses of structure from motion have a unit of their own.
SCALES = (0.25, 0.4, 0.5, 0.67, 0.77, 0.83, 0.91, 1.1, 1.2, 1.3, 1.5, 2.0, 2.5, 4.0)

# Factors that correct the focal length; steps of about 5 percent where a small error is likely.
FOCAL_FACTORS = (
    *(0.1, 0.25, 0.33, 0.4, 0.5, 0.6, 0.7, 0.77, 0.83, 0.87, 0.91, 0.95),
    *(1.05, 1.1, 1.15, 1.2, 1.3, 1.43, 1.67, 2.0, 2.5, 3.0, 4.0, 10.0),
)

# Poses that belong to frames this far before or after.
DELAYS = (-2, -1, 1, 2)


@dataclass(frozen=True)
class Explanation:
    """Something that may be wrong.

    Attributes:
        kind: of the finding.
        cause: for the user, a clause.
        corrected: a frame as it would be right if this is the cause.
    """

    kind: str
    cause: str
    corrected: Callable[[SmallFrame], SmallFrame]


def explained(kind: str) -> Callable[[Evidence, float], dict[str, Any] | None]:
    """Return the check whether an explanation of a kind brings the frames into agreement.

    The limit is the agreement with it, 0 to 1.
    """

    def look(evidence: Evidence, convincing: float) -> dict[str, Any] | None:
        best, recorded = evidence.once(_best), evidence.agreement
        if best is None or recorded is None or best[1].kind != kind:
            return None
        found, explanation = best
        if found.overlap < limits.LEAST_OVERLAP or found.score <= _enough(recorded, convincing):
            return None
        return {"recorded": recorded.score, "then": found.score, "cause": explanation.cause}

    return look


def no_agreement(evidence: Evidence, hopeless: float) -> dict[str, Any] | None:
    """Find frames that agree less than the limit in what they have in common."""
    recorded = evidence.agreement
    if recorded is None or not recorded.is_known or recorded.score >= hopeless:
        return None
    return {"recorded": recorded.score, "overlap": recorded.overlap}


def too_far(evidence: Evidence, hopeless: float) -> dict[str, Any] | None:
    """Find frames that agree less than the limit because stereo sees no shape so far away."""
    found, rig = no_agreement(evidence, hopeless), evidence.capture.rig
    if found is None or rig is None:
        return None
    k = evidence.capture.frames[0].camera.intrinsics
    focal = rig.infrared.fl_x if rig.infrared else k.fx
    seen = [each.depth[each.shown] for each in evidence.frames.values()]
    distance = float(np.nanmedian(np.concatenate(seen)))
    step = distance / (focal * rig.baseline)
    return found | {"distance": distance, "step": step} if step > limits.COARSE_STEP else None


def depth_range(evidence: Evidence, _: float) -> dict[str, Any] | None:
    """Find depth that no depth camera measures."""
    if not evidence.frames:
        return None
    depth = np.concatenate([frame.depth.reshape(-1) for frame in evidence.frames.values()])
    median = float(np.nanmedian(depth))
    if NEAREST <= median <= FARTHEST:
        return None
    return {"median": median, "nearest": NEAREST, "farthest": FARTHEST}


# Frames and points that are looked at, evenly spread.
VIEWS, POINTS = 12, 2000


def points_elsewhere(evidence: Evidence, least: float) -> dict[str, Any] | None:
    """Find sparse points that few cameras look at, that have other colors, or that fit after a turn."""
    from scipy.spatial.transform import Rotation

    capture = evidence.capture
    cloud = capture.load_points() if evidence.knows_poses else None
    if cloud is None or len(cloud) < limits.LEAST_POINTS_IN_COMMON:
        return None
    cloud = cloud.select(np.linspace(0, len(cloud) - 1, min(POINTS, len(cloud))).astype(int))
    points, green = cloud.points_world.astype(np.float64), 255 * cloud.colors[:, 1]
    frames = [capture.frames[number] for number in spread(len(capture), VIEWS)]
    seen = thumbnails(frames, lambda image: green_means(image, -(-image.shape[1] // WIDTH)))
    views = [(f.camera.resized(*g.shape[::-1]), g) for f, g in zip(frames, seen, strict=True)]
    in_view, recorded = _points_fit(points, green, views)
    found = f"{in_view:.0%} of the sparse points are in view of a camera"
    if green.std() < limits.PLAIN_IMAGE:
        return {"found": found} if in_view < least else None
    found += f", and their brightness follows that of the photographs by {recorded:.2f}"
    turns = Rotation.create_group("O").as_matrix()  # those that lay axes on axes
    best = max(_points_fit(points @ turn.T, green, views)[1] for turn in turns)
    enough = max(limits.POINTS_FIT_FACTOR * recorded, recorded + limits.POINTS_FIT_MORE)
    if best > max(enough, limits.POINTS_FIT):
        return {"found": f"{found}, with {best:.2f} if they are turned by right angles"}
    return {"found": found} if in_view < least or recorded < limits.POINTS_MISFIT else None


def _points_fit(
    points: np.ndarray, green: np.ndarray, views: Sequence[tuple[Camera, np.ndarray]]
) -> tuple[float, float]:
    """Return how points, (n, 3), of a brightness, (n,), fit thumbnails; what is nearer hides points.

    The share that any camera looks at, 0 to 1, and the correlation of their brightness with that of the
    thumbnails at their places, -1 to 1; 0 where it tells nothing.
    """
    in_view, here, there = np.zeros(len(points), bool), [np.zeros(0)], [np.zeros(0)]
    for camera, image in views:
        shown, px, front = front_points(camera, points)
        in_view[shown] = True
        column, row = px.astype(int).T
        here.append(green[shown[front]])
        there.append(image[row[front], column[front]])
    one, other = np.concatenate(here), np.concatenate(there)
    is_enough = len(one) >= limits.LEAST_POINTS_IN_COMMON and one.std() > 0 < other.std()
    return float(in_view.mean()), float(np.corrcoef(one, other)[0, 1]) if is_enough else 0.0


def _enough(recorded: Agreement, convincing: float) -> float:
    gain = limits.AGREEMENT_GAIN_FACTOR * recorded.score + limits.AGREEMENT_GAIN_OFFSET
    return max(convincing, gain)


def _best(evidence: Evidence) -> tuple[Agreement, Explanation] | None:
    """Return the explanation with which the frames agree best; None where they cannot agree better."""
    recorded = evidence.agreement
    if recorded is None or _enough(recorded, 0.0) >= 1.0:
        return None
    trials = []
    for each in explanations([frame.camera for frame in evidence.capture.frames]):
        frames = {n: each.corrected(frame) for n, frame in evidence.compared.items()}
        trials.append((agreement(frames, evidence.pairs), each))
    return max(trials, key=lambda trial: trial[0].score)


def explanations(cameras: Sequence[Camera]) -> Iterator[Explanation]:
    """Yield everything that is tried; ``cameras`` are those of all frames."""
    for factor, unit in UNITS.items():
        yield Explanation("depth unit", unit, _scaled_depth(factor))
    for factor in SCALES:
        cause = f"depth and poses are in different units (depth x {factor:g} fits)"
        yield Explanation("scale", cause, _scaled_depth(factor))
    for factor in FOCAL_FACTORS:
        cause = f"the focal length (about {factor:g} times the given one fits)"
        yield Explanation("focal length", cause, _other_focal(factor))
    inverted = "the poses are inverted (camera from world)"
    for cause, right in (
        ("the poses have OpenCV camera axes", lambda pose: pose @ OPENCV_FROM_OPENGL),
        (inverted, _inverted),
        (f"{inverted} and have OpenCV camera axes", invert_rigid),
    ):
        yield Explanation("pose convention", cause, _moved(right))
    along = "the depth is the distance along the ray instead of along the optical axis"
    yield Explanation("depth along rays", along, _planar)
    for delay in DELAYS:
        when = "later" if delay > 0 else "earlier"
        cause = f"each image has the pose of another moment; those {abs(delay)} frame(s) {when} fit"
        yield Explanation("time stamps", cause, _delayed(delay, cameras))


def _scaled_depth(factor: float) -> Callable[[SmallFrame], SmallFrame]:
    return lambda frame: replace(frame, depth=frame.depth * np.float32(factor))


def _other_focal(factor: float) -> Callable[[SmallFrame], SmallFrame]:
    def corrected(frame: SmallFrame) -> SmallFrame:
        k = frame.camera.intrinsics
        other = Intrinsics(k.width, k.height, k.fx * factor, k.fy * factor, k.cx, k.cy)
        return replace(frame, camera=replace(frame.camera, intrinsics=other))

    return corrected


def _moved(right: Callable[[np.ndarray], np.ndarray]) -> Callable[[SmallFrame], SmallFrame]:
    return lambda frame: replace(
        frame, camera=replace(frame.camera, world_from_cam=right(frame.camera.world_from_cam))
    )


def _inverted(world_from_cam: np.ndarray) -> np.ndarray:
    """The index holds the inverse, with OpenGL axes: of the reader's result, take its conversion back."""
    return invert_rigid(world_from_cam @ OPENCV_FROM_OPENGL) @ OPENCV_FROM_OPENGL


def _planar(frame: SmallFrame) -> SmallFrame:
    k = frame.camera.intrinsics
    offsets = (pixel_centers(k.width, k.height) - [k.cx, k.cy]) / [k.fx, k.fy]
    lengths = np.sqrt(1 + np.square(offsets).sum(axis=-1))
    return replace(frame, depth=frame.depth / lengths.astype(np.float32))


def _delayed(delay: int, cameras: Sequence[Camera]) -> Callable[[SmallFrame], SmallFrame]:
    def corrected(frame: SmallFrame) -> SmallFrame:
        other = cameras[min(max(frame.number + delay, 0), len(cameras) - 1)]
        return replace(frame, camera=replace(frame.camera, world_from_cam=other.world_from_cam))

    return corrected
