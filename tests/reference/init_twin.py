"""The initialization written out in float64 NumPy, straight from the formulas (paper eq. 8, 9, 10)."""

from collections import defaultdict

import numpy as np

from digs_warp.geometry.camera import Camera
from digs_warp.init.edges import LAPLACIAN_5X5, MIN_PAIR_WEIGHT

Voxel = tuple[int, int, int]


def laplacian_of_pairs(depth: np.ndarray) -> np.ndarray:
    """|E| pixel by pixel: opposite pairs with both members, scaled up to the whole kernel."""
    height, width = depth.shape
    depth = depth.astype(np.float64)
    result = np.full(depth.shape, np.nan)
    for row, column in np.argwhere(~np.isnan(depth)):
        response = weight = total = 0.0
        for dv in range(-2, 3):
            for du in range(-2, 3):
                kernel = LAPLACIAN_5X5[2 + dv, 2 + du]
                if (dv, du) >= (0, 0) or kernel == 0:
                    continue  # one member of each pair
                total += abs(kernel)
                ends = [(row + dv, column + du), (row - dv, column - du)]
                if all(0 <= v < height and 0 <= u < width for v, u in ends):
                    bend = depth[ends[0]] + depth[ends[1]] - 2 * depth[row, column]
                    if not np.isnan(bend):
                        response += kernel * bend
                        weight += abs(kernel)
        if weight >= MIN_PAIR_WEIGHT * total:
            result[row, column] = abs(response) * total / weight
    return result


def threshold_of(magnitude: np.ndarray) -> float:
    """tau_edge = mean + std / 10 over the known magnitudes of a view."""
    known = magnitude[~np.isnan(magnitude)]
    return float(known.mean() + 0.1 * known.std()) if known.size else float("nan")


def back_projected(camera: Camera, depth: np.ndarray, keep: np.ndarray) -> np.ndarray:
    """World points of the kept pixels, row by row: M^-1 A^-1 (u, v, 1) d, as eq. 8 has it."""
    rows, columns = np.nonzero(keep)
    px = np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))])
    rays_cam = np.linalg.inv(camera.intrinsics.matrix) @ px
    points_cam = rays_cam * depth[rows, columns].astype(np.float64)
    homogeneous = np.vstack([points_cam, np.ones(len(rows))])
    return (np.linalg.inv(camera.cam_from_world) @ homogeneous)[:3].T


def voxel_means(
    points: np.ndarray, values: np.ndarray, voxel_size: float
) -> dict[Voxel, tuple[int, np.ndarray]]:
    """Voxel index -> number of points and mean of their values, in ascending order."""
    members: dict[Voxel, list[int]] = defaultdict(list)
    for index, point in enumerate(points):
        i, j, k = (int(np.floor(c * (1.0 / voxel_size))) for c in point)
        members[i, j, k].append(index)
    return {
        voxel: (len(rows), np.mean(values[rows], axis=0)) for voxel, rows in sorted(members.items())
    }
