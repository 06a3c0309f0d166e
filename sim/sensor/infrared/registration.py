"""Depth of the left infrared eye registered to the color camera, the nearest wins; and that camera.

Eyes and color camera look the same way from places on one line, so that rows stay rows: color pixel row v
gets depth from the rows of the eye that it overlaps. Each depth pixel is a square in front of the eye at its
depth; every color pixel that the moved square overlaps takes its depth, as in the vendor's SDK
(rs2::align moves the corners of each pixel, fills the rectangle between them, and keeps the nearest). That
closes the cracks that a larger focal length opens, and makes near things up to a pixel wider. What the eye
does not see stays empty: a shadow beside near things.
"""

from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from digs_warp.checks import check_shape
from digs_warp.geometry.camera import Camera
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.arrays import launch_rows
from digs_warp.sim.sensor.error_attribution import WRONG
from digs_warp.sim.sensor.frame import Cause, FrameTruth, Sensed
from digs_warp.sim.sensor.highlights import Highlights
from digs_warp.sim.sensor.tiers import code_missing, depth_of

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false


wp.set_module_options({"enable_backward": False})

# A square that reaches into a pixel by less than this does not count: its place is known to about that [px].
TOUCH = wp.constant(wp.float64(1.0e-6))


@wp.kernel
def _register_kernel(
    first: int,
    depth: wp.array2d[float],  # of the left eye, not finite where unknown
    zoom: wp.float64,  # focal length of the color camera over that of the eye
    shift: wp.float64,  # focal length of the color camera times its offset [px m]
    center_x: wp.float64,  # principal point of both [px]
    center_y: wp.float64,
    # outputs
    nearest: wp.array2d[float],  # depth at each color pixel
    source: wp.array2d[int],  # number of the depth pixel that it comes from; -1: none
):
    """Fill one row of the color camera's grid."""
    row = first + wp.tid()
    height = depth.shape[0]
    width = depth.shape[1]
    for column in range(width):
        nearest[row, column] = wp.inf
        source[row, column] = -1
    top = (wp.float64(row) - center_y) / zoom + center_y
    bottom = (wp.float64(row + 1) - center_y) / zoom + center_y
    from_row = wp.max(int(wp.floor(top + TOUCH)), 0)
    to_row = wp.min(int(wp.ceil(bottom - TOUCH)), height)
    for v in range(from_row, to_row):
        for u in range(width):
            z = depth[v, u]
            if z > 0.0 and wp.isfinite(z):
                left = zoom * (wp.float64(u) - center_x) + center_x - shift / wp.float64(z)
                from_column = wp.max(int(wp.floor(left + TOUCH)), 0)
                to_column = wp.min(int(wp.ceil(left + zoom - TOUCH)), width)
                for column in range(from_column, to_column):
                    if z < nearest[row, column]:
                        nearest[row, column] = z
                        source[row, column] = v * width + u


def sources_of(depth: np.ndarray, rig: StereoRig) -> np.ndarray:
    """Return which pixel of the left eye each pixel of the color camera gets, as a flat index; -1: none.

    Args:
        depth: planar depth of the left eye [m], (height, width), float32; not finite where unknown.
        rig: places and focal lengths of eye and color camera.

    Returns:
        (height, width), int32.
    """
    k = rig.intrinsics
    check_shape("depth", depth, (k.height, k.width))
    nearest = np.empty(depth.shape, dtype=np.float32)
    source = np.empty(depth.shape, dtype=np.int32)
    images = [wp.array(image, device="cpu", copy=False) for image in (nearest, source)]
    inputs = [
        wp.array(np.ascontiguousarray(depth), device="cpu", copy=False),
        rig.color_zoom,
        rig.image_intrinsics.fx * rig.color_offset,
        k.cx,
        k.cy,
        *images,
    ]
    launch_rows(_register_kernel, k.height, inputs)
    return source


@dataclass(frozen=True, eq=False)
class ColorView:
    """The truth at the pixel centers of the color camera; arrays as in `FrameTruth`.

    Attributes:
        camera: the color camera.
        image: sRGB, (height, width, 3), uint8, before image noise.
        mask: of the objects, (height, width), uint8.
        depth: planar z [m], (height, width), float32, NaN where there is nothing.
        normals_world: (height, width, 3), float32.
        material_ids: (height, width), int32.
        object_ids: number of the object, (height, width), int32; 0: none.
        highlights: the light above white in the image; None: unknown.
    """

    camera: Camera
    image: np.ndarray
    mask: np.ndarray
    depth: np.ndarray
    normals_world: np.ndarray
    material_ids: np.ndarray
    object_ids: np.ndarray
    highlights: Highlights | None = None

    def as_truth(self, truth: FrameTruth) -> FrameTruth:
        """Return the truth of a sensor that measures from the place of the color camera."""
        return replace(
            truth,
            camera=self.camera,
            image=self.image,
            depth=self.depth,
            normals_world=self.normals_world,
            material_ids=self.material_ids,
            highlights=self.highlights,
        )


@dataclass(frozen=True, eq=False)
class Registered:
    """The sensor's measurement in the image of the color camera, as a capture holds it.

    Attributes:
        depth: [m], (height, width), float32, coded as `depth_of` does.
        cause: `Cause` of each pixel, (height, width), uint8.
        confidence: 0 to 1, (height, width), float32.
    """

    depth: np.ndarray
    cause: np.ndarray
    confidence: np.ndarray

    @staticmethod
    def of(sensed: Sensed, truth: FrameTruth) -> "Registered":
        """Return what a sensor at the place of the color camera has measured."""
        return Registered(depth_of(sensed, truth), sensed.cause, sensed.confidence)


def registered(sensed: Sensed, truth: FrameTruth, view: ColorView) -> Registered:
    """Return the measurement of the left eye in the image of the color camera.

    Args:
        sensed: what the infrared pair measured.
        truth: of the left eye.
        view: of the color camera.
    """
    in_eye = depth_of(sensed, truth)
    source = sources_of(in_eye, truth.rig)
    is_empty = source < 0
    depth, cause, confidence = (
        image.reshape(-1)[source] for image in (in_eye, sensed.cause, sensed.confidence)
    )
    depth[is_empty], confidence[is_empty] = np.nan, 0.0
    cause = np.where(is_empty, _cause_of_holes(sensed, truth, view), cause)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = truth.rig.focal_baseline * (1 / depth - 1 / view.depth)
    failed = ~(np.abs(error) <= WRONG) & np.isfinite(view.depth)
    # The eye was right, but about the surface beside the one that the color camera sees here.
    cause = np.where(failed & (cause == Cause.OK), np.uint8(Cause.EDGE), cause)
    cause = np.where(failed, cause, np.uint8(Cause.OK))
    code_missing(depth, cause)
    return Registered(depth, cause, confidence)


def _cause_of_holes(sensed: Sensed, truth: FrameTruth, view: ColorView) -> np.ndarray:
    """Return why each color pixel would be empty, from what the left eye has at the same point.

    Outside its image: the band. If it sees something nearer there: occlusion.
    """
    rig, k = truth.rig, truth.rig.intrinsics
    height, width = view.depth.shape
    columns = (np.arange(width) + 0.5 - k.cx) / rig.color_zoom + k.cx
    rows = (np.arange(height) + 0.5 - k.cy) / rig.color_zoom + k.cy
    with np.errstate(invalid="ignore", divide="ignore"):
        across = np.floor(columns + k.fx * rig.color_offset / view.depth)
        own = np.float32(rig.focal_baseline) / view.depth
    down = np.broadcast_to(np.floor(rows)[:, None], across.shape)
    inside = (across >= 0) & (across < width) & (down >= 0) & (down < height)
    at = np.where(inside, down * width + across, 0).astype(np.intp)
    cause = sensed.cause.reshape(-1)[at]
    cause[truth.disparity.reshape(-1)[at] > own + WRONG] = Cause.OCCLUDED
    cause[~inside] = Cause.BAND
    return cause
