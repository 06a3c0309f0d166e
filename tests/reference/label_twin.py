"""Labels the slow way, in float64: points moved by matrices, occlusion by a ray against every triangle.

Where rows are seen at different times, the twin tries every band and keeps those in which the point lands in
the band's own rows, instead of searching from one band to the next.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.data.layers import Occlusion
from digs_warp.sim.render.views import CameraTrack
from digs_warp.sim.scene.scene import Scene

# A hit this much nearer than the point, as a share of the distance, hides it.
NEARER = 1e-3


@dataclass(frozen=True, eq=False)
class Landings:
    """Where each pixel's point is seen, (height, width): NaN where no band, or more than one, sees it."""

    shift: np.ndarray  # [px], (height, width, 2)
    depth: np.ndarray  # [m]
    points: np.ndarray  # in the world [m], (height, width, 3)
    seen_from: np.ndarray  # center of the source at each pixel [m], (height, width, 3)
    looked_at_from: np.ndarray  # center of the target [m], (height, width, 3)


def landings(source: CameraTrack, depth: np.ndarray, target: CameraTrack) -> Landings:
    height, width = depth.shape
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    k = source.intrinsics
    rays = np.stack([(columns - k.cx) / k.fx, (rows - k.cy) / k.fy, np.ones_like(rows)], axis=-1)
    poses = np.repeat(source.world_from_cam[:, 0], np.diff(source.edges), axis=0)
    points = np.einsum("rij,rcj->rci", poses[:, :3, :3], rays * depth[..., None].astype(np.float64))
    points += poses[:, None, :3, 3]
    shift, z = np.full((height, width, 2), np.nan), np.full((height, width), np.nan)
    away = np.full((height, width, 3), np.nan)
    found = np.zeros((height, width), int)
    k, edges = target.intrinsics, target.edges
    for band, pose in enumerate(target.world_from_cam[:, 0]):
        cam = (points - pose[:3, 3]) @ pose[:3, :3]
        x, y = (k.matrix[:2] @ (cam / cam[..., 2:]).reshape(-1, 3).T).reshape(2, height, width)
        first = -np.inf if band == 0 else edges[band]
        last = np.inf if band + 1 == len(target.world_from_cam) else edges[band + 1]
        here = (cam[..., 2] > 0) & (y >= first) & (y < last)
        found += here
        shift[here] = np.stack([x - columns, y - rows], axis=-1)[here]
        z[here], away[here] = cam[..., 2][here], pose[:3, 3]
    shift[found != 1], z[found != 1] = np.nan, np.nan
    seen_from = np.broadcast_to(poses[:, None, :3, 3], points.shape)
    return Landings(shift, z, points, seen_from, away)


def occlusion(landed: Landings, scene: Scene) -> np.ndarray:
    """`Occlusion` of each pixel among opaque triangles, (height, width), uint8."""
    height, width = landed.depth.shape
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    x, y = columns + landed.shift[..., 0], rows + landed.shift[..., 1]
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)  # NaN is not
    state = np.full((height, width), Occlusion.OUTSIDE, np.uint8)
    triangles = scene.vertices[scene.faces].astype(np.float64)
    for row, column in np.argwhere(inside):
        point, away = landed.points[row, column], landed.looked_at_from[row, column]
        reach = np.linalg.norm(point - away)
        distances, cosines = _hits(away, (point - away) / reach, triangles)
        hidden = (distances < reach * (1 - NEARER)).any()
        own = int(np.argmin(distances)) if len(distances) else -1
        if not hidden and own >= 0 and distances[own] < reach * (1 + NEARER):
            before = point - landed.seen_from[row, column]
            _, first = _hits(landed.seen_from[row, column], before, triangles[[own]])
            hidden = bool(first[0] * cosines[own] < 0)
        state[row, column] = Occlusion.HIDDEN if hidden else Occlusion.SEEN
    return state


def _hits(
    origin: np.ndarray, direction: np.ndarray, triangles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distance along a ray to each triangle, infinite where it misses, and dot(normal, direction)."""
    a, b, c = (triangles[:, i] for i in range(3))
    normals = np.cross(b - a, c - a)
    cosines = normals @ direction
    with np.errstate(divide="ignore", invalid="ignore"):
        distances = np.einsum("ni,ni->n", normals, a - origin) / cosines
    at = origin + distances[:, None] * direction
    inside = distances > 0
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("ni,ni->n", np.cross(end - start, at - start), normals) >= 0
    return np.where(inside, distances, np.inf), cosines
