"""Which points of structure from motion join the depth points (paper section 3.3.2)."""

from collections.abc import Sequence

import numpy as np

from digs_warp.data.capture import Frame
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.sfm_model import SfmModel
from digs_warp.init.local_scales import pixels_at


def unmasked_points_in_box(
    sfm: SfmModel, frames: Sequence[Frame], mask_threshold: int, box: tuple[np.ndarray, np.ndarray]
) -> PointCloud:
    """Return P_BB: the sparse points that no mask rejects, inside the box of the depth points.

    A point has to lie in the mask of every one of ``frames`` that saw it; one that none of them saw is
    left out, since nothing vouches for it.

    Args:
        sfm: the model, in the unit of ``box``.
        frames: training frames with masks.
        mask_threshold: a mask value above it is object.
        box: corners (minimum, maximum), shape (3,) each.
    """
    seen = np.zeros(len(sfm.points), dtype=bool)
    rejected = np.zeros(len(sfm.points), dtype=bool)
    for frame in frames:
        if frame.name not in sfm.names:
            continue
        index = sfm.names.index(frame.name)
        mine = sfm.observations.cameras == index
        points = sfm.observations.points[mine]
        mask = frame.load_mask()
        k = sfm.cameras[index].intrinsics
        height, width = mask.shape
        px = sfm.observations.px[mine] * np.array([width / k.width, height / k.height])
        columns, rows = pixels_at(px, width, height)
        seen[points] = True
        rejected[points[mask[rows, columns] <= mask_threshold]] = True
    positions = sfm.points.points_world
    in_box = np.all((positions >= box[0]) & (positions <= box[1]), axis=1)
    keep = seen & ~rejected & in_box
    return PointCloud(positions[keep], sfm.points.colors[keep])
