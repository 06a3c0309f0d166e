# open3d's compiled modules come without usable stubs:
# pyright: reportAttributeAccessIssue=false, reportCallIssue=false
"""Depth views -> a colored triangle mesh: a truncated signed distance field (Curless and Levoy 1996).

Open3D's sparse voxel grid does the work: every view moves the voxels near its surface towards their
signed distance along the line of sight; the mesh is the zero level of the mean (marching cubes).
"""

from collections.abc import Iterable

import numpy as np

from digs_warp.checks import DigsError, check_positive
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.device.libraries import import_open3d
from digs_warp.surface.depth_views import DepthView

# The field extends this many voxels to both sides of the surface: enough for noise of a voxel, but so thin
# that the two sides of a wall of 8 voxels do not touch.
TRUNCATION_VOXELS = 4.0

# A surface needs voxels that at least this many views saw: single views leave flaps at silhouettes.
LEAST_VIEWS = 3.0

# Along the edge of the scene; finer grids fill the memory but show no more detail than the splats have.
MOST_VOXELS = 2000

BLOCK_VOXELS = 16
FIRST_BLOCKS = 4096  # the grid grows when needed


def fuse_views(
    views: Iterable[DepthView],
    voxel: float,
    center_world: np.ndarray,
    radius: float,
) -> TriangleMesh:
    """Return the surface that the views agree on, inside a ball; empty without views or depth.

    Args:
        views: at least `LEAST_VIEWS` of each part that is to be seen.
        voxel: edge of a voxel [m]; details below are lost.
        center_world: center of the ball [m]; depth outside is left out, so strays cost no memory.
        radius: of the ball [m].

    Raises:
        DigsError: a voxel that is not above 0, or too small for the ball.
        MissingLibraryError: Open3D cannot be loaded; the message names what to install.
    """
    check_positive("voxel size [m]", voxel)
    if 2 * radius / voxel > MOST_VOXELS:
        raise DigsError(
            f"voxels of {voxel:.3g} m for a scene of {2 * radius:.3g} m: more than {MOST_VOXELS} along an "
            f"edge; use at least {2 * radius / MOST_VOXELS:.2g} m"
        )
    core = import_open3d().core
    grid = import_open3d().t.geometry.VoxelBlockGrid(
        ("tsdf", "weight", "color"),
        (core.float32, core.float32, core.float32),
        ((1,), (1,), (3,)),
        voxel,
        BLOCK_VOXELS,
        FIRST_BLOCKS,
        core.Device("CPU:0"),
    )
    seen = 0
    for view in views:
        seen += _integrate(grid, view, inside_ball(view, center_world, radius))
    # Open3D refuses to search an empty grid.
    mesh = grid.extract_triangle_mesh(LEAST_VIEWS) if seen else None
    if mesh is None or "indices" not in mesh.triangle or not len(mesh.triangle.indices):
        return TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)))
    return TriangleMesh(
        mesh.vertex.positions.numpy(),
        mesh.triangle.indices.numpy(),
        np.clip(mesh.vertex.colors.numpy(), 0.0, 1.0),
    )


def inside_ball(view: DepthView, center_world: np.ndarray, radius: float) -> np.ndarray:
    """Return the depth [m] of a view, 0 where it is unknown or its point is outside the ball."""
    k = view.camera.intrinsics
    u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
    points = view.camera.unproject(np.stack([u, v], axis=-1), view.depth)
    with np.errstate(invalid="ignore"):
        inside = np.linalg.norm(points - center_world, axis=-1) <= radius
    return np.where(inside, view.depth, 0.0).astype(np.float32)


def _integrate(grid: object, view: DepthView, depth: np.ndarray) -> bool:
    """Add one view to a `VoxelBlockGrid`, and return whether it holds any depth.

    ``depth`` [m] is 0 where there is none.
    """
    farthest = float(depth.max(initial=0.0))
    if farthest <= 0:
        return False
    open3d = import_open3d()
    tensor, image = open3d.core.Tensor, open3d.t.geometry.Image
    # The grid cuts projected coordinates down to pixel numbers: pixel centers are at 0.5, as ours are.
    k = tensor(view.camera.intrinsics.matrix)
    cam_from_world = tensor(view.camera.cam_from_world)
    depth_image = image(tensor(depth))
    color_image = image(tensor(np.ascontiguousarray(view.color, dtype=np.float32)))
    # Depth is in metres (scale 1), and everything up to the farthest counts.
    limits = (1.0, 1.001 * farthest, TRUNCATION_VOXELS)
    blocks = grid.compute_unique_block_coordinates(depth_image, k, cam_from_world, *limits)
    grid.integrate(blocks, depth_image, color_image, k, k, cam_from_world, *limits)
    return True
