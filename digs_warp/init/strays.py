"""Strays: points alone in the air. An extension of the paper.

Wrong depth can put a point metres away from the object, where only one view looks: no other view sees
through it, and in small images most voxels hold as few measurements as it does. A surface, however thin, is
a chain of points one voxel apart; a stray has next to nothing around it.
"""

import numpy as np

from digs_warp.init.voxel import voxel_keys

# Points are counted in cells of this many times the distance between points, and in the cells around them.
CELL = 8.0

# Points with fewer than this many in their cell and the cells around it, themselves included, are strays.
COMPANY = 4

# The distance between points is measured from this many of them.
SAMPLES = 1000


def in_company(points_world: np.ndarray, voxel_size: float) -> np.ndarray:
    """Return which points have others around them, shape (n,), bool; all if none has.

    Where depth maps are coarser than the voxels, the distance between the points counts, not the voxel size.

    Args:
        points_world: one point per voxel [m], shape (n, 3).
        voxel_size: edge length of the voxels [m].
    """
    from scipy.spatial import KDTree  # pyright: ignore[reportAttributeAccessIssue]

    count = len(points_world)
    if count < COMPANY:
        return np.ones(count, dtype=bool)
    edge = CELL * max(voxel_size, _spacing(points_world))
    _, first, cell_of, counts = np.unique(
        voxel_keys(points_world, edge), return_index=True, return_inverse=True, return_counts=True
    )
    cells = KDTree(np.floor(points_world[first] / edge))
    # Neighbors differ by at most 1 along each axis; 1.5 is safe against rounding.
    one, other = cells.query_pairs(1.5, p=np.inf, output_type="ndarray").T
    around = counts + np.bincount(one, counts[other], len(counts))
    around += np.bincount(other, counts[one], len(counts))
    accompanied = (around >= COMPANY)[cell_of]
    return accompanied if accompanied.any() else np.ones(count, dtype=bool)


def _spacing(points_world: np.ndarray) -> float:
    """Return the median distance of points to their nearest neighbor [m]."""
    from scipy.spatial import KDTree  # pyright: ignore[reportAttributeAccessIssue]

    tree = KDTree(points_world, balanced_tree=False, compact_nodes=False)
    sample = points_world[:: max(1, len(points_world) // SAMPLES)]
    return float(np.median(tree.query(sample, k=2)[0][:, 1]))
