"""Where the other eye sees what one eye sees: true disparity of both eyes, and what is occluded.

Both eyes are taken as they stand, so that the disparity leads from a pixel of one recorded image to the same
point in the other. Without drift of the calibration that is f b / Z. With it the two differ: a matcher can
only find what the images show, while the depth of the capture is the scene's.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.sim.record.labels.seen import Seen
from digs_warp.sim.render.protocol import Renderer


@dataclass(frozen=True, eq=False)
class PairDisparity:
    """True disparity of a stereo pair; all of shape (height, width).

    Attributes:
        left: column in the left image minus that in the right one [px], float32; NaN: nothing there.
        right: the same for the pixels of the right image.
        occlusion_left: whether the right image shows the points of the left one, uint8; see
            `digs_warp.data.occlusion.Occlusion`.
        occlusion_right: the other way round.
    """

    left: np.ndarray
    right: np.ndarray
    occlusion_left: np.ndarray
    occlusion_right: np.ndarray


def pair_disparity(renderer: Renderer, left: Seen, right: Seen) -> PairDisparity:
    """Return the disparity between what two eyes see at the same time."""
    to_right = renderer.follow(left.track, left.depth, left.material_ids, right.track)
    to_left = renderer.follow(right.track, right.depth, right.material_ids, left.track)
    return PairDisparity(
        left=-to_right.shift[..., 0],
        right=to_left.shift[..., 0].copy(),
        occlusion_left=to_right.occlusion,
        occlusion_right=to_left.occlusion,
    )
