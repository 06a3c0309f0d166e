"""The visual hull: a start for an object with masks and without depth (Laurentini 1994).

A place that lies inside the masks of all views that show it may belong to the object. The skin of all such
places encloses the object; it misses hollows that no silhouette tells of, which the training then finds.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.device.threads import over_items, over_rows
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.reproject import reproject
from digs_warp.geometry.rigid import grown
from digs_warp.init.config import InitConfig
from digs_warp.init.depth_points import NoPointsError, require_layers
from digs_warp.init.sparse_points import cube_looked_at
from digs_warp.init.view_points import map_frames
from digs_warp.words import counted

logger = logging.getLogger(__name__)

# The first grid fills this many times the cube that the cameras look at, with as many cells along a side.
AROUND, COARSE = 1.5, 64

# The second one fills the object with at most this many: masks and poses are no more precise.
FINEST = 128

# A cell belongs to the hull if at least this share of the views that show it have it in their mask, so that a
# mask with a gap does not cut the object, and at least this share of all views show it.
AGREEING, SHOWING = 0.95, 0.5

# Mask values above it are at least half object: unlike in other stages a soft rim must not widen the object.
HALF = 127

# A view tells the color of a place whose outward normal points towards it, to this cosine.
FACING = 0.3

# Points that a thread looks at together.
POINTS_AT_ONCE = 100_000

# Masks of more pixels along a side are thinned: a cell of the finest grid then still covers several.
MASK_SIDE = 1000


# A camera, and what its mask shows, thinned to at most `MASK_SIDE` pixels.
_View = tuple[Camera, np.ndarray]


@dataclass(frozen=True, eq=False)
class Hull:
    """Cells of a grid with the corner ``low`` [m] and cubes of ``edge`` [m]; ``inside``: which are object."""

    low: np.ndarray
    edge: float
    inside: np.ndarray

    def place_of(self, cells: np.ndarray) -> np.ndarray:
        """Return the centers [m] of cells, indices of shape (n, 3)."""
        return self.low + self.edge * (cells + 0.5)

    def skin(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the centers [m] of the cells with a neighbor outside, (n, 3), and their outward normals."""
        from scipy.ndimage import binary_erosion, gaussian_filter

        cells = np.argwhere(self.inside & np.logical_not(binary_erosion(self.inside)))
        soft = np.asarray(gaussian_filter(self.inside.astype(np.float32), 2.0))
        slopes = [np.gradient(soft, axis=axis) for axis in range(3)]
        normals = -np.stack([np.asarray(slope)[tuple(cells.T)] for slope in slopes], axis=1)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        return self.place_of(cells), normals / np.maximum(lengths, 1e-9)


def hull_points(frames: Sequence[Frame], config: InitConfig) -> PointCloud:
    """Return the skin of the visual hull, one point per cell, colored as the views that face it see it.

    Args:
        frames: with image and mask, at least two that look from different directions.
        config: the edge of a cell: its voxel size, by default two pixels at the object's distance; and
            how many points at most, chosen at random, always the same ones.

    Raises:
        DigsError: a frame without mask, or cameras that all look in the same direction.
        NoPointsError: no place is inside the masks of the views that show it.
    """
    points, normals = visual_hull(frames, config).skin()
    cloud = PointCloud(points, _colors(points, normals, frames))
    most = config.target_points
    if most is None or len(cloud) <= most:
        return cloud
    drawn = np.random.default_rng(0).choice(len(cloud), size=most, replace=False)
    return cloud.select(np.sort(drawn))


def visual_hull(frames: Sequence[Frame], config: InitConfig, edge: float | None = None) -> Hull:
    """Return which cells of a grid lie inside the masks of the views that show them.

    Args:
        frames: with mask, at least two that look from different directions.
        config: the edge of a cell, as of `hull_points`.
        edge: of a cell [m], instead; at least the object's longest side / `FINEST`.

    Raises:
        DigsError: as of `hull_points`.
    """
    require_layers(frames, (Layer.MASK,))
    views = over_items(frames, _thinned)
    center, half = cube_looked_at([frame.camera for frame in frames])
    coarse = 2 * AROUND * half / COARSE
    # Half a cell of slack: a thin part may lie between the centers of cells.
    rough = _carved(views, center - AROUND * half, coarse, (COARSE,) * 3, coarse / 2)
    if not rough.inside.any():
        raise NoPointsError(
            f"initialization: no place lies inside the masks of the {counted(len(frames), 'view')} that show "
            "it: masks or poses are wrong, or the masks show other objects; look at the masks, check the "
            "poses, or start with --strategy default"
        )
    found = np.argwhere(rough.inside)
    low, high = (rough.low + coarse * each for each in (found.min(0) - 1, found.max(0) + 2))
    sides = high - low
    if edge is None:
        pixel = float(np.median([_pixel_at(frame.camera, center) for frame in frames]))
        edge = config.voxel_size or config.defaults.voxel_pixels * pixel
    edge = max(edge, float(sides.max()) / FINEST)
    hull = _carved(views, low - edge, edge, np.ceil(sides / edge).astype(int) + 2)
    if not hull.inside.any():
        raise NoPointsError("initialization: the object is thinner than a cell of its hull")
    return hull


def _thinned(frame: Frame) -> _View:
    mask = frame.load_mask()
    step = -(-max(mask.shape) // MASK_SIDE)
    mask = mask[::step, ::step] > HALF
    return frame.camera.resized(mask.shape[1], mask.shape[0]), mask


def _carved(
    views: Sequence[_View],
    low: np.ndarray,
    edge: float,
    shape: Sequence[int] | np.ndarray,
    slack: float = 0.0,
) -> Hull:
    """Return a grid; inside are the cells that enough views have in their masks, grown by ``slack`` [m]."""
    cells = low + edge * (np.indices(tuple(shape)).reshape(3, -1).T + 0.5)
    middle = cells.mean(axis=0)
    masks = [grown(mask, slack / _pixel_at(c, middle)) if slack else mask for c, mask in views]

    def inside(rows: slice) -> np.ndarray:
        part = cells[rows]
        showing, missing = np.zeros((2, len(part)), dtype=np.int32)
        left = np.arange(len(part))  # those that may still belong to the hull
        for (camera, _), mask in zip(views, masks, strict=True):
            seen = reproject(part[left], camera.cam_from_world, camera.intrinsics)
            showing[left] += seen.inside
            missing[left] += seen.inside & ~mask[seen.rows, seen.columns]
            left = left[missing[left] <= (1 - AGREEING) * len(views)]
        agrees = missing <= (1 - AGREEING) * showing
        return agrees & (showing >= SHOWING * len(views))

    parts = over_rows(len(cells), inside, POINTS_AT_ONCE)
    return Hull(low, edge, np.concatenate(parts).reshape(tuple(shape)))


def _colors(points: np.ndarray, normals: np.ndarray, frames: Sequence[Frame]) -> np.ndarray:
    """Return the mean color of each point in the views that it faces, (n, 3); the mean of all for others."""
    sums, counts = np.zeros((len(points), 3)), np.zeros(len(points))

    def work(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
        image, mask = frame.load_image(), frame.load_mask() > HALF
        rays = frame.camera.center_world - points
        facing = (normals * rays).sum(axis=1) > FACING * np.linalg.norm(rays, axis=1)
        k = frame.camera.intrinsics
        _, inside, rows, columns = reproject(points, frame.camera.cam_from_world, k)
        use = facing & inside & mask[rows, columns]
        return use, image[rows[use], columns[use]] / 255.0

    for use, colors in map_frames(frames, work):
        sums[use] += colors
        counts += use
    typical = sums.sum(axis=0) / counts.sum() if counts.any() else np.full(3, 0.5)
    return np.where(counts[:, None] > 0, sums / np.maximum(counts, 1)[:, None], typical)


def _pixel_at(camera: Camera, center: np.ndarray) -> float:
    """Return the width of a pixel at the distance of a place [m]."""
    return float(np.linalg.norm(camera.center_world - center)) / camera.intrinsics.fx
