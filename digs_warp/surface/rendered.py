"""Distance of the surface that the Gaussians show to the true one: no mesh is made, so it takes no Open3D."""

from collections.abc import Sequence

import numpy as np

from digs_warp.data.evenly import evenly
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.layers import Layer
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.measure.surface_metrics import DEFAULT_SAMPLES, sample_surface, surface_score
from digs_warp.measure.visible_places import visible_places
from digs_warp.surface.depth_views import DepthView, depth_views
from digs_warp.surface.error import SurfaceError
from digs_warp.surface.extract import within_mask

# Of all around the object; the figures hardly change with more views or points.
VIEWS = 16
POINTS = 40_000

# Only its share of points uses this distance [m]; the figures here do not.
_NEAR = 0.005


def surface_error(
    gaussians: Gaussians, frames: Sequence[Frame], truth: TriangleMesh, device: str = "cpu"
) -> SurfaceError | None:
    """Compare the surface of the Gaussians, as seen from some of the cameras, with the true mesh.

    Args:
        gaussians: the result.
        frames: where to look from, with masks where they have them: depth outside does not count.
        truth: in the same world.
        device: "cpu" or a CUDA device of Warp.

    Returns:
        None if no view shows a surface.
    """
    chosen = evenly(frames, VIEWS)
    center = gaussians.means.mean(axis=0)
    views = depth_views(gaussians, [frame.camera for frame in chosen], center, device)
    points = np.concatenate([_points(v, f) for v, f in zip(views, chosen, strict=True)])
    if not len(points) or not len(truth):
        return None
    points = points[:: -(-len(points) // POINTS)]
    score = surface_score(points, truth, _NEAR)
    return SurfaceError(
        score.accuracy, score.completeness, _seen_completeness(points, chosen, truth)
    )


def _seen_completeness(
    points: np.ndarray, frames: Sequence[Frame], truth: TriangleMesh
) -> float | None:
    """Return the mean distance [m] to the nearest point from what frames see of the true surface."""
    from scipy.spatial import KDTree

    places = sample_surface(truth, DEFAULT_SAMPLES)
    seen = visible_places(places, truth, [frame.camera for frame in frames])
    if not seen.any():
        return None
    distances, _ = KDTree(points).query(places[seen], workers=-1)
    return float(distances.mean())


def _points(view: DepthView, frame: Frame) -> np.ndarray:
    """Return the points of the surface in the world [m], shape (n, 3)."""
    if frame.has(Layer.MASK):
        view = within_mask(view, frame.load_mask())
    rows, columns = np.nonzero(np.isfinite(view.depth))
    pixels = np.stack([columns + 0.5, rows + 0.5], axis=-1)
    return view.camera.unproject(pixels, view.depth[rows, columns])
