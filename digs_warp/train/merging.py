"""One splat where several share a pixel: what no photograph tells apart need not be drawn apart.

After a third of the run, splats become one whose centers lie in the same cell of the view that samples them
most finely, each nearer to the next one than their deviations together. It has their mean, covariance and
color, weighted by opacity and area, and lets through as much light.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.reproject import reproject
from digs_warp.geometry.rigid import matrix_from_quat_xyzw, quat_xyzw_from_matrix
from digs_warp.train.density import Refinement

# Share of the run after which splats are merged: by then they have found their places.
MERGE_AT = 1.0 / 3.0

# Width of a cell [px]: with more splats, they learn the noise of the photographs (docs/training.md).
CELL = 1.25

# No splat is more opaque than 1 minus this.
_LEAST_THROUGH = 1e-3


def merged(gaussians: Gaussians, cameras: Sequence[Camera], held: np.ndarray) -> Refinement:
    """Return the Gaussians with one in place of several that share a pixel.

    Args:
        gaussians: with the scales that are drawn.
        cameras: of the training views.
        held: which Gaussians stay as they are, shape (n,), bool.
    """
    count = len(gaussians)
    cells, depths = finest_cells(gaussians.means, cameras)
    cells = np.where(held | (cells < 0), -1 - np.arange(count), cells)
    order = np.lexsort((depths, cells))
    g = gaussians.select(order)
    widths = np.exp(g.log_scales.mean(axis=1, dtype=np.float64))
    behind = np.diff(depths[order]) > widths[1:] + widths[:-1]
    begins = np.flatnonzero(np.append(True, behind | (np.diff(cells[order]) != 0)))
    sizes = np.diff(begins, append=count)
    weights = g.opacities * widths**2
    weights /= np.repeat(np.add.reduceat(weights, begins), sizes)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.add.reduceat(np.einsum("n,n...->n...", weights, values), begins)

    means = mean(g.means)
    offsets = g.means - np.repeat(means, sizes, axis=0)
    axes = matrix_from_quat_xyzw(g.quats.astype(np.float64)) * g.scales[:, None, :]
    squares = axes @ np.swapaxes(axes, -1, -2) + offsets[:, :, None] * offsets[:, None, :]
    variances, turns = np.linalg.eigh(mean(squares))
    turns[np.linalg.det(turns) < 0, :, 0] *= -1
    through = np.maximum(np.multiply.reduceat(1.0 - g.opacities, begins), _LEAST_THROUGH)
    found = replace(
        gaussians,
        means=means,
        log_scales=0.5 * np.log(np.maximum(variances, 1e-16)),
        quats=quat_xyzw_from_matrix(turns),
        opacity_logits=np.log((1.0 - through) / through),
        sh=mean(g.sh),
    )
    alone, first = sizes == 1, order[begins]
    for name in FIELDS:
        getattr(found, name)[alone] = getattr(gaussians, name)[first[alone]]
    return Refinement(found, first, alone)


def finest_cells(points: np.ndarray, cameras: Sequence[Camera]) -> tuple[np.ndarray, np.ndarray]:
    """Return in which cell of the view that samples it most finely each point lies, and how deep [m].

    Cells are numbered over all views; -1: no view shows the point. Both have shape (n,).
    """
    numbers, depths = np.full(len(points), -1), np.zeros(len(points))
    finest, first = np.full(len(points), np.inf), 0
    for camera in cameras:
        k = camera.intrinsics
        k = k.resized(round(k.width / CELL), round(k.height / CELL))
        seen = reproject(points, camera.cam_from_world, k)
        nearer = seen.inside & (seen.depth / max(k.fx, k.fy) < finest)
        finest[nearer] = seen.depth[nearer] / max(k.fx, k.fy)
        depths[nearer] = seen.depth[nearer]
        numbers[nearer] = (first + seen.rows * k.width + seen.columns)[nearer]
        first += k.width * k.height
    return numbers, depths
