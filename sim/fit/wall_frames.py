"""Frames of a wall as the eye sees them from which depth is measured.

That is the camera of the frame, or the left infrared eye beside it. There depth is registered to the color
camera; it is looked up from the eye along the plane of the wall, so that noise, static field and drift are
found where they arise.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.rig import InfraredPair, Rig
from digs_warp.geometry.camera import Intrinsics
from digs_warp.sim.fit.plane import fit_plane
from digs_warp.sim.sensor.infrared.pair import in_three_channels


@dataclass(frozen=True, eq=False)
class WallFrame:
    """A frame of the eye.

    Attributes:
        name: of the frame.
        image: of the eye, sRGB, (height, width, 3), uint8; equal channels of an infrared eye.
        disparity: as the camera reports it [px], (height, width), float32, NaN where it has none.
        looked: where depth could be: in the mask and in the image of the camera that reports it, bool.
        true: like ``disparity``; None: not known.
        right: of the other eye; None: not recorded.
        color: of the color camera beside an infrared pair; None: there is none.
    """

    name: str
    image: np.ndarray
    disparity: np.ndarray
    looked: np.ndarray
    true: np.ndarray | None
    right: np.ndarray | None
    color: np.ndarray | None


def eye_of(color: Intrinsics, rig: Rig | None) -> Intrinsics:
    """Return the camera of the eye; ``color`` is that of the frames."""
    if rig is None or rig.infrared is None:
        return color
    pair = rig.infrared
    return Intrinsics(color.width, color.height, pair.fl_x, pair.fl_y, pair.cx, pair.cy)


def load_frames(capture: Capture, focal_baseline: float) -> Iterator[WallFrame]:
    """Yield the frames of a recording of a wall.

    Args:
        capture: its frames have depth, and those of an infrared pair its images.
        focal_baseline: of the eye [px m].

    Raises:
        DigsError: a frame that lacks one of these, or has another camera than the first.
    """
    first = capture.frames[0].camera.intrinsics
    for frame in capture.frames:
        where = f"{capture}, frame '{frame.name}'"
        if not frame.has(Layer.DEPTH):
            raise DigsError(
                f"{where}: no depth; expected depth as the camera reports it. Record "
                "it, or give a stereo pair with true disparity"
            )
        if frame.camera.intrinsics != first:
            raise DigsError(
                f"{where}: another camera than that of the first frame; fit the "
                "recordings of each camera alone"
            )
        if capture.rig is not None and capture.rig.infrared is not None:
            yield _of_infrared(frame, capture.rig.infrared, focal_baseline, where)
        else:
            yield _of_left(frame, focal_baseline)


def _of_left(frame: Frame, focal_baseline: float) -> WallFrame:
    true, mask = _true(frame), _mask(frame)
    return WallFrame(
        frame.name,
        image=frame.load_image(),
        disparity=np.float32(focal_baseline) / _depth(frame, mask),
        looked=mask,
        true=None if true is None else np.float32(focal_baseline) / true,
        right=frame.load_right_image() if frame.has(Layer.RIGHT) else None,
        color=None,
    )


def _of_infrared(frame: Frame, pair: InfraredPair, focal_baseline: float, where: str) -> WallFrame:
    for layer in (Layer.INFRARED_LEFT, Layer.INFRARED_RIGHT):
        if not frame.has(layer):
            raise DigsError(
                f"{where}: no {layer.label}; expected both images of the infrared pair that the capture "
                "names. Record them, or take 'infrared' out of its rig to fit the color camera alone"
            )
    true, mask = _true(frame), _mask(frame)
    depth = _depth(frame, mask)
    row, column, inside = _in_color(depth, frame.camera.intrinsics, pair, focal_baseline)

    def seen(image: np.ndarray, outside: float) -> np.ndarray:
        # Taken as it is: both cameras look the same way, so that depth is the same.
        return np.where(inside, image[row, column], image.dtype.type(outside))

    left, right = (in_three_channels(image) for image in frame.load_infrared())
    return WallFrame(
        frame.name,
        image=left,
        disparity=np.float32(focal_baseline) / seen(depth, np.nan),
        looked=seen(mask, 0),
        true=None if true is None else np.float32(focal_baseline) / seen(true, np.nan),
        right=right,
        color=frame.load_image(),
    )


def _mask(frame: Frame) -> np.ndarray:
    if frame.has(Layer.MASK):
        return frame.load_mask() >= 128
    k = frame.camera.intrinsics
    return np.ones((k.height, k.width), bool)


def _depth(frame: Frame, mask: np.ndarray) -> np.ndarray:
    return np.where(mask, frame.load_depth(), np.float32(np.nan))


def _true(frame: Frame) -> np.ndarray | None:
    return frame.load_depth_true() if frame.has(Layer.DEPTH_TRUE) else None


def _in_color(
    depth: np.ndarray, k: Intrinsics, pair: InfraredPair, focal_baseline: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the pixel of the color image that shows each pixel of the left infrared eye.

    1 / Z of a plane is affine in the pixels of the color camera, so that they follow directly.

    Args:
        depth: of a wall, registered to the color camera [m], (height, width), float32, NaN where unknown.
        k: of the color camera.
        pair: the infrared eyes.
        focal_baseline: of the eye [px m].

    Returns:
        Rows, columns, and whether they are in the image; (height, width) each. Without a wall: in none.
    """
    height, width = depth.shape
    plane = fit_plane(focal_baseline / depth)
    a, b, c = np.full(3, np.nan) if plane is None else plane.coefficients / focal_baseline
    rows = ((np.arange(height) + 0.5 - pair.cy) / pair.fl_y * k.fy + k.cy)[:, None]
    # u = straight + shift / Z(u, v), where 1 / Z = a u + b v + c.
    straight = (np.arange(width) + 0.5 - pair.cx) / pair.fl_x * k.fx + k.cx
    shift = k.fx * pair.offset
    columns = (straight + shift * (b * rows + c)) / (1 - shift * a)
    rows, columns = np.broadcast_arrays(rows, columns)
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    row, column = (np.where(inside, each, 0).astype(int) for each in (rows, columns))
    return row, column, inside
