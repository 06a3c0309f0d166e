"""What the viewer draws beside Gaussians, as Gaussians; and the pictures of cameras."""

from collections.abc import Callable

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.sh import sh_from_rgb
from digs_warp.show.report.causes import paint_causes
from digs_warp.show.report.pictures import depth_scale, shrink, shrink_factor

# The standard deviation of a point, as a share of the radius of what is shown.
POINT_SIZE = 0.003
OPAQUE = 6.0  # a logit

# Width of a picture of a camera [px].
WIDTH = 480


def points_as_splats(cloud: PointCloud, radius: float) -> Gaussians:
    """Return a small opaque ball for each point; ``radius`` is that of what is shown."""
    count = len(cloud)
    return Gaussians(
        means=cloud.points_world,
        log_scales=np.full((count, 3), np.log(POINT_SIZE * radius)),
        quats=np.zeros((count, 4)),
        opacity_logits=np.full(count, OPAQUE),
        sh=sh_from_rgb(cloud.colors.astype(np.float64))[:, None],
    )


def _depth_picture(frame: Frame) -> np.ndarray:
    depth = frame.load_depth()
    return depth_scale(depth.ravel()).paint(depth)


def _cause_picture(frame: Frame) -> np.ndarray:
    causes = frame.load_cause()
    return paint_causes(causes, shrink_factor(causes.shape[1], WIDTH))


# What is shown of a camera: the layer that it needs, and how it is painted, (height, width, 3), uint8.
PICTURES: dict[str, tuple[Layer, Callable[[Frame], np.ndarray]]] = {
    "photograph": (Layer.IMAGE, Frame.load_image),
    "measured depth": (Layer.DEPTH, _depth_picture),
    "why depth is missing": (Layer.CAUSE, _cause_picture),
}


def pictures_of(frames: tuple[Frame, ...]) -> list[str]:
    """Return what can be shown of at least one of the frames."""
    return [
        name for name, (layer, _) in PICTURES.items() if any(frame.has(layer) for frame in frames)
    ]


def load_picture(frame: Frame, name: str) -> np.ndarray | None:
    """Return a small picture, (height, width, 3), uint8; None where the frame does not have it.

    Raises:
        CaptureError: its image cannot be read.
    """
    layer, paint = PICTURES[name]
    if not frame.has(layer):
        return None
    return shrink(paint(frame), WIDTH)
