"""Distance of the surface that the Gaussians show to the true one: no mesh is made, so it takes no Open3D."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.layers import Layer
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.data.viewpoints import evenly
from digs_warp.measure.scores import SurfaceError
from digs_warp.measure.surface_metrics import (
    DEFAULT_SAMPLES,
    distances_to_surface,
    sample_with_normals,
    visible_places,
)
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.surface_depth import drawn_surfaces, surface_depth
from digs_warp.surface.extract import depth_within

# Of all around the object; the figures hardly change with more views, or more points for the accuracy.
VIEWS = 16
POINTS = 40_000


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
    cameras = [frame.camera for frame in chosen]
    on_device = DeviceGaussians.from_numpy(gaussians, device)
    drawn = drawn_surfaces(on_device, cameras, gaussians.means.mean(axis=0), is_object=True)
    with ThreadPoolExecutor(1) as beside:  # while the next view is rendered
        pairs = zip(chosen, drawn, strict=True)
        shown = [beside.submit(_points, frame, view.depth.to_numpy()) for frame, view in pairs]
    points = np.concatenate([each.result() for each in shown])
    if not len(points) or not len(truth):
        return None
    places, normals = sample_with_normals(truth, DEFAULT_SAMPLES)
    with ThreadPoolExecutor(1) as beside:
        # All points: with few of them, the distance to the nearest would be mostly that between neighbors.
        nearest = beside.submit(_nearest, points, places)  # building the tree takes one core
        some = points[:: -(-len(points) // POINTS)]
        accuracy = float(distances_to_surface(some, truth).mean())
        seen = visible_places(places, normals, truth, cameras)
        missing = nearest.result()
    of_seen = float(missing[seen].mean()) if seen.any() else None
    return SurfaceError(accuracy, float(missing.mean()), of_seen)


def _nearest(points: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the distance from each place to the nearest point, (m,)."""
    from scipy.spatial import KDTree

    # Such a tree finds the same in half of the time: there are far more points than places.
    return KDTree(points, balanced_tree=False, compact_nodes=False).query(places, workers=-1)[0]


def _points(frame: Frame, drawn: np.ndarray) -> np.ndarray:
    """Return the points of the surface that a frame sees, in the world [m], shape (n, 3)."""
    depth = surface_depth(drawn)
    if frame.has(Layer.MASK):
        depth = depth_within(depth, frame.load_mask())
    rows, columns = np.nonzero(np.isfinite(depth))
    pixels = np.stack([columns + 0.5, rows + 0.5], axis=-1)
    return frame.camera.unproject(pixels, depth[rows, columns])
