"""What the viewer draws beside Gaussians, as Gaussians; and the pictures of cameras."""

from collections.abc import Callable

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import to_uint8
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.geometry.sh import sh_from_rgb
from digs_warp.show.report.causes import paint_causes

# The standard deviation of a point, as a share of the radius of what is shown.
POINT_SIZE = 0.003
# Discs that stand for a mesh, their standard deviation in distances between them, and how flat they are.
DISCS, DISC_SIZE, DISC_THICKNESS = 150_000, 0.6, 0.1

OPAQUE = 6.0  # a logit

# Width of a picture of a camera [px].
WIDTH = 480


def points_as_splats(cloud: PointCloud, radius: float) -> Gaussians:
    """Return a small opaque ball for each point; ``radius`` is that of what is shown."""
    scales = np.full((len(cloud), 3), np.log(POINT_SIZE * radius))
    return _splats(cloud.points_world, scales, np.zeros((len(cloud), 4)), cloud.colors)


def mesh_as_splats(mesh: TriangleMesh) -> Gaussians:
    """Return flat discs evenly spread over the triangles; the same ones for the same mesh."""
    corners = mesh.points_world[mesh.triangles].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(normals, axis=1)
    if not areas.sum() > 0:
        return points_as_splats(PointCloud(mesh.points_world, mesh.colors), 1.0)
    rng = np.random.default_rng(0)
    chosen = np.searchsorted(np.cumsum(areas), (np.arange(DISCS) + 0.5) / DISCS * areas.sum())
    chosen = np.minimum(chosen, len(areas) - 1)
    # Even within a triangle: the square root keeps them off its first corner.
    far, side = np.sqrt(rng.random(DISCS)), rng.random(DISCS)
    shares = np.stack([1 - far, far * (1 - side), far * side], axis=1)[..., None]
    n = normals[chosen] / (2 * areas[chosen, None])
    turned = np.stack([-n[:, 1], n[:, 0], np.zeros(DISCS), 1 + n[:, 2]], axis=1)  # z to the normal
    turned[n[:, 2] < -1 + 1e-9] = [1.0, 0.0, 0.0, 0.0]
    wide = DISC_SIZE * np.sqrt(areas.sum() / DISCS)
    scales = np.tile(np.log([wide, wide, DISC_THICKNESS * wide]), (DISCS, 1))
    colors = (shares * mesh.colors[mesh.triangles[chosen]]).sum(axis=1)
    return _splats((shares * corners[chosen]).sum(axis=1), scales, turned, colors)


def _splats(
    means: np.ndarray, scales: np.ndarray, quats: np.ndarray, colors: np.ndarray
) -> Gaussians:
    sh = sh_from_rgb(colors.astype(np.float64))
    return Gaussians(means, scales, quats, np.full(len(means), OPAQUE), sh.reshape(-1, 1, 3))


def _depth_picture(frame: Frame) -> np.ndarray:
    depth = frame.load_depth()
    return painted_depth(depth, np.isfinite(depth) & (depth > 0))


def _cause_picture(frame: Frame) -> np.ndarray:
    causes = frame.load_cause()
    return paint_causes(causes, max(1, causes.shape[1] // WIDTH))


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
    full = paint(frame)
    step = max(1, full.shape[1] // WIDTH)
    return np.ascontiguousarray(full[::step, ::step])


def painted_depth(depth: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return depth in colors, near bright, white where nothing is seen, (height, width, 3), uint8."""
    import matplotlib

    picture = np.full((*depth.shape, 3), 255, np.uint8)
    if seen.any():
        low, high = np.percentile(depth[seen], [1, 99])
        share = np.clip((depth[seen] - low) / max(high - low, 1e-9), 0.0, 1.0)
        picture[seen] = to_uint8(matplotlib.colormaps["viridis"](1.0 - share)[:, :3])
    return picture
