"""The pictures in the cameras on the page: photograph, measured depth, why depth is missing."""

from typing import Literal

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.show.report.causes import paint_causes
from digs_warp.show.view.true_render import painted_depth

Picture = Literal["photograph", "measured depth", "why depth is missing", "nothing"]

LAYERS: dict[Picture, Layer] = {
    "photograph": Layer.IMAGE,
    "measured depth": Layer.DEPTH,
    "why depth is missing": Layer.CAUSE,
}

# Width of a picture in a camera [px].
WIDTH = 240


def pictures_of(frames: tuple[Frame, ...]) -> list[Picture]:
    """Return what the cameras can show, for at least one of the frames."""
    known: list[Picture] = [
        name for name, layer in LAYERS.items() if any(frame.has(layer) for frame in frames)
    ]
    return [*known, "nothing"]


def load_picture(frame: Frame, picture: Picture) -> np.ndarray | None:
    """Return a small picture, (height, width, 3), uint8; None where the frame does not have it.

    Raises:
        CaptureError: its image cannot be read.
    """
    if picture == "nothing" or not frame.has(LAYERS[picture]):
        return None
    if picture == "photograph":
        full = frame.load_image()
    elif picture == "measured depth":
        depth = frame.load_depth()
        full = painted_depth(depth, np.isfinite(depth) & (depth > 0))
    else:
        causes = frame.load_cause()
        full = paint_causes(causes, max(1, causes.shape[1] // WIDTH))
    step = max(1, full.shape[1] // WIDTH)
    return np.ascontiguousarray(full[::step, ::step])
