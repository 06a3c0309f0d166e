"""How closely the surface of the Gaussians keeps to the depth that was measured.

The figure is the median of |z - d| over the object's pixels of some training views: z the depth of their
surface, d the measured depth. The noise of the sensor is in it: a perfect surface has the median of the
noise, not 0. Outliers of the sensor and the rim of the object do not change a median.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.viewpoints import evenly
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import PixelBox, mask_box
from digs_warp.splat.camera_motion import RowMotion
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.surface_depth import drawn_surfaces, surface_depth
from digs_warp.train.shutter import NO_SHUTTER, Shutter

# The median hardly changes with more views, and each takes the time of a training step.
VIEWS = 8

DepthLayer = Literal[Layer.DEPTH, Layer.DEPTH_TRUE]

# Mask values from this on belong to the object.
OBJECT = 128


@dataclass(frozen=True, eq=False)
class MeasuredView:
    """The measured depth of one view."""

    camera: Camera  # of the whole image
    box: PixelBox  # of the object in the image
    depth: np.ndarray  # inside the box [m], NaN where unknown or not on the object, float32
    rows: RowMotion | None = None  # how the camera moves while its rows are read; None: not at all
    is_object: bool = True  # whether a mask tells an object from the rest


def load_measured_views(
    frames: Sequence[Frame],
    shutter: Shutter = NO_SHUTTER,
    layer: DepthLayer = Layer.DEPTH,
) -> list[MeasuredView]:
    """Read the depth of at most `VIEWS` frames, evenly spread; frames without depth are left out.

    Args:
        frames: of the recording.
        shutter: how the cameras move while their rows are read.
        layer: the measured depth, or the true one of a simulated recording.

    Raises:
        CaptureError: a file is missing or broken.
    """
    known = [frame for frame in frames if frame.has(layer)]
    return [_measured(frame, layer, shutter.rows_of(frame)) for frame in evenly(known, VIEWS)]


def _measured(frame: Frame, layer: DepthLayer, rows: RowMotion | None) -> MeasuredView:
    depth = frame.load_depth() if layer is Layer.DEPTH else frame.load_depth_true()
    mask = np.full(depth.shape, 255, np.uint8)
    is_object = frame.has(Layer.MASK)
    if is_object:
        mask = frame.load_mask()
    box = mask_box(mask)
    x0, y0, x1, y1 = box
    known = (mask >= OBJECT) & np.isfinite(depth) & (depth > 0)
    kept = np.where(known, depth, np.float32(np.nan))[y0:y1, x0:x1]
    return MeasuredView(frame.camera, box, kept.astype(np.float32), rows, is_object)


def adherence(gaussians: DeviceGaussians, views: Sequence[MeasuredView]) -> float | None:
    """Return the median distance [m] between rendered and measured depth; None where nothing compares.

    A pixel compares where depth was measured and the Gaussians cover it by half.
    """
    found = signed_distances(gaussians, views)
    return float(np.median(np.abs(found))) if len(found) else None


def signed_distances(gaussians: DeviceGaussians, views: Sequence[MeasuredView]) -> np.ndarray:
    """Return rendered minus measured depth [m] of all pixels that compare, (n,), float64."""
    if not views or not len(gaussians):
        return np.zeros(0)
    cameras, rows = [view.camera for view in views], [view.rows for view in views]
    is_object = any(view.is_object for view in views)
    center = gaussians.means.numpy().mean(axis=0)
    drawn = drawn_surfaces(gaussians, cameras, center, is_object, rows)
    pairs = zip(drawn, views, strict=True)
    return np.concatenate([_distances(renderer.depth.to_numpy(), view) for renderer, view in pairs])


def _distances(drawn: np.ndarray, view: MeasuredView) -> np.ndarray:
    x0, y0, x1, y1 = view.box
    distances = surface_depth(drawn[y0:y1, x0:x1]).astype(np.float64) - view.depth
    return distances[np.isfinite(distances)]
