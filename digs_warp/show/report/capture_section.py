"""The contact sheet of a capture: images, depth and depth errors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.viewpoints import evenly
from digs_warp.show.report.causes import describe_causes, paint_causes
from digs_warp.show.report.markup import (
    legend,
    part,
    picture,
    picture_grid,
    swatches,
)
from digs_warp.show.report.pictures import (
    ColorScale,
    data_uri,
    depth_scale,
    error_scale,
    shrink,
    shrink_factor,
)
from digs_warp.words import counted

MAX_FRAMES = 6
THUMBNAIL_WIDTH = 400  # pixels; the columns are about half as wide on a common screen

_OUTSIDE = np.uint8(255)  # white: where errors are not shown

_TRUE, _SENSED = Layer.DEPTH_TRUE, Layer.DEPTH


@dataclass(frozen=True)
class _Column:
    """One column of the sheet: which layers it needs, and how it paints a frame (RGB, uint8)."""

    heading: str
    alt: str
    needs: tuple[Layer, ...]
    paint: Callable[[Frame], np.ndarray]


def capture_section(capture: Capture, findings: Sequence[str] = ()) -> str:
    """Return the section; columns whose files no shown frame has are left out.

    Args:
        capture: the recording.
        findings: what does not fit together in it.
    """
    frames = evenly(capture.frames, MAX_FRAMES)
    depths = _depth_scale(frames)
    errors = _error_scale(frames)
    columns = [
        column
        for column in _columns(depths, errors)
        if any(all(map(frame.has, column.needs)) for frame in frames)
    ]
    rows = [
        (f"{frame.name}\n{frame.time:.2f} s", [_cell(column, frame) for column in columns])
        for frame in frames
    ]
    headings = [column.heading for column in columns]
    needed = {key for column in columns for key in column.needs}
    legends = [legend(depths, missing=True)] if needed & {_TRUE, _SENSED} else []
    legends += [legend(errors, missing=True)] if needed >= {_TRUE, _SENSED} else []
    warnings = "".join(
        f"<p><strong>Warning:</strong> {escape(finding)}</p>" for finding in findings
    )
    k = frames[0].camera.intrinsics
    return part(
        "recording",
        "Recording",
        f"{counted(len(capture), 'frame')} of {k.width} by {k.height} pixels"
        + (", with warnings" if warnings else ""),
        warnings,
        f"<p>{len(frames)} of them, evenly spaced. {escape(_scale_words(frames))}</p>",
        picture_grid(headings, rows),
        f"<div class=legends>{''.join(legends)}</div>",
        swatches(causes) if (causes := describe_causes(capture, frames)) else "",
    )


def _scale_words(frames: Sequence[Frame]) -> str:
    """Say which pixels the color scales of depths and their errors fit."""
    if any(frame.has(Layer.MASK) for frame in frames):
        return (
            "Depths share one color scale that is fitted to the object; what lies farther has its darkest "
            "color. Errors are shown on the object."
        )
    return "Depths share one color scale that is fitted to everything in view."


def _columns(depths: ColorScale, errors: ColorScale) -> list[_Column]:
    def gray(frame: Frame) -> np.ndarray:
        return np.repeat(frame.load_mask()[..., None], 3, axis=2)

    def infrared(frame: Frame) -> np.ndarray:
        return np.repeat(frame.load_infrared()[0][..., None], 3, axis=2)

    def error(frame: Frame) -> np.ndarray:
        # The surroundings are much farther away and noisier, and would hide the object's errors.
        return np.where(_on_object(frame)[..., None], errors.paint(_error_mm(frame)), _OUTSIDE)

    return [
        _Column("Left", "left image", (Layer.IMAGE,), Frame.load_image),
        _Column("Right", "right image", (Layer.RIGHT,), Frame.load_right_image),
        _Column(
            "Infrared, left",
            "left infrared image",
            (Layer.INFRARED_LEFT, Layer.INFRARED_RIGHT),
            infrared,
        ),
        _Column(
            "Depth, true",
            "true depth in colors",
            (_TRUE,),
            lambda frame: depths.paint(frame.load_depth_true()),
        ),
        _Column(
            "Depth, sensed",
            "sensed depth in colors",
            (_SENSED,),
            lambda frame: depths.paint(frame.load_depth()),
        ),
        _Column("Depth error", "sensed minus true depth in colors", (_TRUE, _SENSED), error),
        _Column(
            "Cause of errors",
            "cause of missing and wrong depth in colors and patterns",
            (Layer.CAUSE,),
            lambda frame: paint_causes(
                causes := frame.load_cause(), shrink_factor(causes.shape[1], THUMBNAIL_WIDTH)
            ),
        ),
        _Column("Mask", "object mask, white on the object", (Layer.MASK,), gray),
    ]


def _cell(column: _Column, frame: Frame) -> str:
    if not all(map(frame.has, column.needs)):
        return ""
    image = shrink(column.paint(frame), THUMBNAIL_WIDTH)
    return picture(
        data_uri(image), f"Frame {frame.name}: {column.alt}", image.shape[1], image.shape[0]
    )


def _depth_scale(frames: Sequence[Frame]) -> ColorScale:
    depths = [
        load(frame)[_on_object(frame)]
        for frame in frames
        for key, load in ((_TRUE, Frame.load_depth_true), (_SENSED, Frame.load_depth))
        if frame.has(key)
    ]
    return depth_scale(np.concatenate([np.zeros(0, np.float32), *depths]))


def _error_scale(frames: Sequence[Frame]) -> ColorScale:
    errors = [
        _error_mm(frame)[_on_object(frame)]
        for frame in frames
        if frame.has(_TRUE) and frame.has(_SENSED)
    ]
    return error_scale(np.concatenate([np.zeros(0, np.float32), *errors]))


def _error_mm(frame: Frame) -> np.ndarray:
    return 1000 * (frame.load_depth() - frame.load_depth_true())


def _on_object(frame: Frame) -> np.ndarray:
    """Return which pixels lie on the object, bool; without a mask all do."""
    k = frame.camera.intrinsics
    if not frame.has(Layer.MASK):
        return np.ones((k.height, k.width), dtype=bool)
    return frame.load_mask() > 127
