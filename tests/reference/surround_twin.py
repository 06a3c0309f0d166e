"""The surround's boundary in float64: a ray ends where it leaves the region, found by bisection."""

import numpy as np

from digs_warp.sim.scene.environment import Surround


def inside(surround: Surround, points: np.ndarray) -> np.ndarray:
    """Return which points, (..., 3), lie in the region."""
    away = points - np.array(surround.center)
    if surround.is_room:
        return np.asarray((np.abs(away) <= surround.half_size).all(axis=-1))
    held = (away**2).sum(axis=-1) <= surround.radius**2
    return held if surround.floor is None else held & (points[..., 2] >= surround.floor)


def exits(surround: Surround, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Return by how many times its length each ray, (..., 3), must grow to reach the boundary."""
    low, high = np.zeros(rays.shape[:-1]), np.full(rays.shape[:-1], 1e3)
    for _ in range(80):
        middle = (low + high) / 2
        held = inside(surround, origin + middle[..., None] * rays)
        low, high = np.where(held, middle, low), np.where(held, high, middle)
    return low


def normals(surround: Surround, points: np.ndarray) -> np.ndarray:
    """Return the inward normals at points of the boundary, (..., 3), except in corners."""
    away = points - np.array(surround.center)
    if surround.is_room:
        share = away / surround.half_size
        nearest = np.abs(share).argmax(axis=-1)
        return -np.eye(3)[nearest] * np.sign(np.take_along_axis(share, nearest[..., None], -1))
    outward = -away / np.linalg.norm(away, axis=-1, keepdims=True)
    if surround.floor is None:
        return outward
    on_floor = np.abs(points[..., 2] - surround.floor) < 1e-6
    return np.where(on_floor[..., None], [0.0, 0.0, 1.0], outward)


def panorama_directions_of(surround: Surround, points: np.ndarray) -> np.ndarray:
    """Return the unit directions in which the panorama shows points of the boundary, (..., 3)."""
    away = points - np.array(surround.center)
    if surround.is_room:
        away = away / surround.half_size
    return away / np.linalg.norm(away, axis=-1, keepdims=True)
