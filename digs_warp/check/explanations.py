"""What may be wrong with a capture, and what its frames would be if it were."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.check.finding import Kind
from digs_warp.check.small_frames import SmallFrame
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL, invert_rigid

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
        advice: what to do, a sentence.
        corrected: a frame as it would be right if this is the cause.
        delays: whether it only takes the poses of other frames.
    """

    kind: Kind
    cause: str
    advice: str
    corrected: Callable[[SmallFrame], SmallFrame]
    delays: bool = False


def explanations(cameras: Sequence[Camera]) -> Iterator[Explanation]:
    """Yield everything that the checks try; ``cameras`` are those of all frames."""
    for factor, unit in UNITS.items():
        advice = (
            "Write depth and poses in metres, or 16-bit depth in millimetres (for --from tum in 5000 per "
            "metre)."
        )
        yield Explanation("depth unit", unit, advice, _scaled_depth(factor))
    for factor in SCALES:
        yield Explanation(
            "scale",
            f"depth and poses are in different units (depth x {factor:g} fits)",
            "Both are in metres. Poses without a metric scale: use --poses sfm.",
            _scaled_depth(factor),
        )
    for factor in FOCAL_FACTORS:
        yield Explanation(
            "focal length",
            f"the focal length (about {factor:g} times the given one fits)",
            "Check fl_x and fl_y; they belong to images of the size w x h.",
            _other_focal(factor),
        )
    axes = "Poses are world from camera, with OpenGL camera axes (x right, y up, z backward)."
    convention = "pose convention"
    yield Explanation(convention, "the poses have OpenCV camera axes", axes, _moved(_opencv_axes))
    yield Explanation(
        convention, "the poses are inverted (camera from world)", axes, _moved(_inverted)
    )
    yield Explanation(
        convention,
        "the poses are inverted (camera from world) and have OpenCV camera axes",
        axes,
        _moved(invert_rigid),
    )
    yield Explanation(
        "depth along rays",
        "the depth is the distance along the ray instead of along the optical axis",
        "Divide it by the length of the ray (x, y, 1) of each pixel.",
        _planar,
    )
    for delay in DELAYS:
        when = "later" if delay > 0 else "earlier"
        yield Explanation(
            "time stamps",
            f"each image has the pose of another moment; those {abs(delay)} frame(s) {when} fit",
            "Check the timestamps.",
            _delayed(delay, cameras),
            delays=True,
        )


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


def _opencv_axes(world_from_cam: np.ndarray) -> np.ndarray:
    return world_from_cam @ OPENCV_FROM_OPENGL


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
