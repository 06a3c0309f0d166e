"""Gaussians -> a colored triangle mesh: where to look from, how fine, what to leave out."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.geometry.camera import Camera
from digs_warp.record.progress import progress
from digs_warp.surface.depth_views import DepthView, depth_views, toward_measured
from digs_warp.surface.fuse import fuse_views

# Voxels along the diameter of the ball around the scene, if the user gives no size.
VOXELS_ACROSS = 160

# Depth further than this many radii from the center is not part of the object.
BALL_MARGIN = 1.3

# Mask values of a segmentation above this are object.
OBJECT_THRESHOLD = 127

# Parts with less than this share of the triangles of the largest one are floaters.
LEAST_SHARE = 0.02

# Read an image of each camera, (height, width).
Layers = Sequence[Callable[[], np.ndarray]]


@dataclass(frozen=True, eq=False)
class Cleaned:
    """A mesh without floaters, and how many parts and triangles were removed."""

    mesh: TriangleMesh
    removed_parts: int
    removed_triangles: int


@dataclass(frozen=True, eq=False)
class Scene:
    """The ball in the world [m] that holds the object."""

    center_world: np.ndarray
    radius: float

    @property
    def voxel(self) -> float:
        """The default voxel size [m]."""
        return 2 * self.radius / VOXELS_ACROSS


def extract_surface(
    gaussians: Gaussians,
    cameras: Sequence[Camera],
    scene: Scene,
    voxel: float | None = None,
    masks: Layers | None = None,
    device: str = "cpu",
    is_object: bool = True,
    measured: Layers | None = None,
    trust: float = 1.0,
) -> Cleaned:
    """Return the surface of the Gaussians as the cameras see it, without floaters.

    Args:
        gaussians: of one object, or of all in view.
        cameras: all around it; parts that fewer than three see are missing.
        scene: where the object is.
        voxel: edge of a voxel [m]; default: the ball's diameter / 160.
        masks: the object mask of each camera, uint8: depth outside is left out.
        device: "cpu" or a CUDA device of Warp; the fusion runs on the CPU.
        is_object: whether the Gaussians are of one object, trained with masks.
        measured: the measured depth of each camera [m], which the rendered one is drawn to.
        trust: in the measured depth, 0 to 1.

    Raises:
        DigsError: the cameras see no surface, or the voxels are too small.
    """
    views: Iterable[DepthView] = depth_views(
        gaussians, cameras, scene.center_world, device, is_object
    )
    if measured is not None:
        views = (
            toward_measured(view, load(), trust) for view, load in zip(views, measured, strict=True)
        )
    if masks is not None:
        views = (within_mask(view, load()) for view, load in zip(views, masks, strict=True))
    mesh = fuse_views(
        _with_progress(views, len(cameras)),
        scene.voxel if voxel is None else voxel,
        scene.center_world,
        BALL_MARGIN * scene.radius,
    )
    if not len(mesh):
        raise DigsError(
            f"surface: the {len(cameras)} cameras see none: too few of them, or Gaussians too faint to "
            "cover half of a pixel; train longer, or choose larger voxels"
        )
    return remove_floaters(mesh)


def within_mask(view: DepthView, mask: np.ndarray) -> DepthView:
    """Return the view with depth where the mask says object; ``mask`` is (height, width), 0..255."""
    return DepthView(view.camera, view.color, depth_within(view.depth, mask))


def depth_within(depth: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return depth [m] where the mask says object, else NaN; both are (height, width)."""
    return np.where(mask > OBJECT_THRESHOLD, depth, np.float32(np.nan))


def _with_progress(views: Iterable[DepthView], count: int) -> Iterator[DepthView]:
    with progress(count, "Fusing depth", "view") as bar:
        for view in views:
            yield view
            bar.update()


def remove_floaters(mesh: TriangleMesh, least_share: float = LEAST_SHARE) -> Cleaned:
    """Return the parts that are at least ``least_share`` as large as the largest, by triangles.

    Parts are connected through shared vertices. ``least_share`` of 1 keeps the largest alone.
    """
    if not len(mesh):
        return Cleaned(mesh, 0, 0)
    parts = triangle_parts(mesh)
    sizes = np.bincount(parts)
    kept = sizes >= least_share * sizes.max()
    chosen = mesh.triangles[kept[parts]]
    used = np.zeros(len(mesh.points_world), dtype=bool)
    used[chosen] = True
    numbers = np.cumsum(used) - 1
    smaller = TriangleMesh(mesh.points_world[used], numbers[chosen], mesh.colors[used])
    # Vertices without a triangle are also parts of the graph: they do not count.
    removed = int(np.count_nonzero(~kept & (sizes > 0)))
    return Cleaned(smaller, removed, len(mesh) - len(smaller))


def triangle_parts(mesh: TriangleMesh) -> np.ndarray:
    """Return the number of the part of each triangle, shape (m,), int."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    a, b, c = mesh.triangles.T
    rows, columns = np.concatenate([a, b]), np.concatenate([b, c])
    count = len(mesh.points_world)
    graph = coo_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=(count, count))
    _, part_of_vertex = connected_components(graph, directed=False)
    return part_of_vertex[a]
