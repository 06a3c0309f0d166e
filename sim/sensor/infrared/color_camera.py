"""The color camera of a rig with an infrared pair: what it sees, and depth in its image."""

from dataclasses import dataclass, replace

import numpy as np

from digs_warp.geometry.camera import Camera
from digs_warp.sim.sensor.blame import WRONG
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.highlights import Highlights
from digs_warp.sim.sensor.infrared.registration import sources_of
from digs_warp.sim.sensor.tiers import code_missing, depth_of


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
