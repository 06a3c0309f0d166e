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
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.renderer import SplatRenderer
from digs_warp.splat.surface_depth import surface_depth, surface_place
from digs_warp.train.shutter import NO_SHUTTER, Shutter

# The median hardly changes with more views, and each takes the time of a training step.
VIEWS = 8

DepthLayer = Literal[Layer.DEPTH, Layer.DEPTH_TRUE]

# Mask values from this on belong to the object.
OBJECT = 128


@dataclass(frozen=True, eq=False)
class MeasuredView:
    """The measured depth of one view.

    Attributes:
        camera: of the whole image.
        box: of the object in the image.
        depth: inside the box [m], NaN where unknown or not on the object, float32.
        rows: how the camera moves while its rows are read; None: not at all.
        is_object: whether a mask tells an object from the rest.
    """

    camera: Camera
    box: PixelBox
    depth: np.ndarray
    rows: RowMotion | None = None
    is_object: bool = True


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
    (found,) = signed_distances(gaussians, views)
    return float(np.median(np.abs(found))) if len(found) else None


def signed_distances(
    gaussians: DeviceGaussians, *groups: Sequence[MeasuredView]
) -> list[np.ndarray]:
    """Return rendered minus measured depth [m] of all pixels that compare, (n,), float64, for each group.

    Groups can measure the same views: each is rendered once.
    """
    sizes = [view.camera.intrinsics for views in groups for view in views]
    if not sizes or not len(gaussians):
        return [np.zeros(0) for _ in groups]
    place = surface_place(any(view.is_object for views in groups for view in views))
    renderer = SplatRenderer(
        gaussians,
        max(k.width for k in sizes),
        max(k.height for k in sizes),
        options=RasterOptions(outputs="depth", depth_of=place),
    )
    center = gaussians.means.numpy().mean(axis=0)
    found: list[list[np.ndarray]] = [[np.zeros(0)] for _ in groups]
    for same in _by_camera(groups):
        first = same[0][1]
        renderer.forward(first.camera, near=near_plane(first.camera, center), rows=first.rows)
        drawn = renderer.depth.to_numpy()
        for group, view in same:
            found[group].append(_distances(drawn, view))
    return [np.concatenate(each) for each in found]


def _by_camera(
    groups: Sequence[Sequence[MeasuredView]],
) -> list[list[tuple[int, MeasuredView]]]:
    """Return the views of each camera, with the numbers of their groups, in the order of the views."""
    views: dict[int, list[tuple[int, MeasuredView]]] = {}
    for number, group in enumerate(groups):
        for view in group:
            views.setdefault(id(view.camera), []).append((number, view))
    return list(views.values())


def _distances(drawn: np.ndarray, view: MeasuredView) -> np.ndarray:
    x0, y0, x1, y1 = view.box
    distances = surface_depth(drawn[y0:y1, x0:x1]).astype(np.float64) - view.depth
    return distances[np.isfinite(distances)]
