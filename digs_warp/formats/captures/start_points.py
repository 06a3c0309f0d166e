"""The points that other programs' trainers start from: those that our own start takes from the depth maps."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.formats.captures.frames import for_each_frame
from digs_warp.init.config import InitConfig
from digs_warp.init.depth_points import NoPointsError, depth_points
from digs_warp.init.scene_points import scene_points
from digs_warp.init.visibility import DepthViews, confirmed

logger = logging.getLogger(__name__)

_NO_POINTS = PointCloud(np.zeros((0, 3)), np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class StartPoints:
    """Points of the training frames, one per voxel.

    Attributes:
        cloud: the points; none if the capture has no depth.
        voxel_size: edge length of their grid, the finest one of a scene [m].
        training: the frames that they come from, and that a trainer may see.
    """

    cloud: PointCloud
    voxel_size: float
    training: Sequence[Frame]

    def __len__(self) -> int:
        return len(self.cloud)


def start_points(capture: Capture) -> StartPoints:
    """Return the points that `digs-warp reconstruct` starts from by default, with the recorded poses.

    They are the object's if the capture has masks, else the scene's. Held-out frames do not contribute.

    Raises:
        DigsError: a file of the capture cannot be read.
    """
    training = capture.split()[0] or list(capture.frames)
    with_depth = [frame for frame in training if frame.has(Layer.DEPTH)]
    with_mask = [frame for frame in with_depth if frame.has(Layer.MASK)]
    cloud, report = _NO_POINTS, None
    try:
        if with_mask:
            cloud, report = depth_points(with_mask, InitConfig())
        elif with_depth:
            cloud, report = scene_points(with_depth, InitConfig())
    except NoPointsError as error:
        logger.warning("%s: exported without points to start from: %s", capture, error)
    return StartPoints(cloud, report.voxel_size if report else 0.0, training)


def sightings(capture: Capture, start: StartPoints) -> list[np.ndarray]:
    """Return for each frame the indices of the points that it shows, ascending.

    A frame shows a point if its depth there is that of the point. Held-out frames have none.
    """
    training = set(start.training)

    def work(_: int, frame: Frame) -> np.ndarray:
        if not len(start) or frame not in training or not frame.has(Layer.DEPTH):
            return np.zeros(0, dtype=np.int64)
        view = DepthViews.of([(frame.camera, frame.load_depth())])
        return np.flatnonzero(confirmed(start.cloud.points_world, view, start.voxel_size))

    return for_each_frame(capture.frames, "Finding points in images", work)
