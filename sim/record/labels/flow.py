"""Where a camera sees the points of an image in its next frame: optical flow and change of disparity.

The scene does not move, so depth and the two poses say everything. Flow and change of disparity together are
the scene flow, in the form of the Scene Flow data sets (Mayer et al., CVPR 2016): with the disparity of the
first frame they give every point's place in both frames.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.sim.record.labels.seen import Seen
from digs_warp.sim.render.protocol import CameraTrack, Renderer


@dataclass(frozen=True, eq=False)
class FlowToNext:
    """The motion of an image's points.

    Attributes:
        field: how far a point moves to the right and down, and by how much its disparity f b / Z grows [px],
            (height, width, 3), float32; NaN where it is behind the camera by then.
        occlusion: whether the next image shows it, (height, width), uint8; see
            `digs_warp.data.occlusion.Occlusion`.
    """

    field: np.ndarray
    occlusion: np.ndarray


def flow_to_next(renderer: Renderer, seen: Seen, later: CameraTrack, baseline: float) -> FlowToNext:
    """Return the motion of the points of an image until the next frame.

    Args:
        renderer: of the scene.
        seen: the image.
        later: the same camera during the next frame.
        baseline: of the eyes [m].
    """
    moved = renderer.follow(seen.track, seen.depth, seen.material_ids, later)
    focal_baseline = seen.track.intrinsics.fx * baseline
    change = focal_baseline / moved.depth.astype(np.float64) - focal_baseline / seen.depth
    field = np.concatenate([moved.shift, change[..., None].astype(np.float32)], axis=-1)
    return FlowToNext(field, moved.occlusion)
