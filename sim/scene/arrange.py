"""The scene of several mesh files: each in its size and at rest, together on the ground."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.geometry.rigid import rotation_in_plane
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.load import MeshFile, read_mesh
from digs_warp.sim.scene.scene import MOST_OBJECTS, Scene

# Distance between neighbors, as a share of the median length of the plans; drawn for each object.
GAPS = (0.03, 0.15)

# Directions in which a place for an object is looked for.
DIRECTIONS = 48

FULL_TURN = 2.0 * np.pi


def arrange(plans: Sequence[np.ndarray], rng: np.random.Generator) -> list[np.ndarray]:
    """Return the motion of each object to its place: a turn about z and a shift along x and y [m], (4, 4).

    The largest comes first, each next one where the cluster stays smallest.

    Args:
        plans: corners of the convex hull of each object seen from above [m], (k, 2), around the origin.
        rng: source of turns, directions and gaps.
    """
    yaws = rng.uniform(0.0, FULL_TURN, len(plans))
    gaps = rng.uniform(*GAPS, len(plans)) * np.median(
        [np.ptp(plan, axis=0).max() for plan in plans]
    )
    first_directions = rng.uniform(0.0, FULL_TURN, len(plans))
    turned = [plan @ rotation_in_plane(yaw).T for plan, yaw in zip(plans, yaws, strict=True)]
    order = sorted(range(len(plans)), key=lambda i: -_area(plans[i]))
    positions = {order[0]: np.zeros(2)}
    for i in order[1:]:
        there = [turned[j] + positions[j] for j in positions]
        angles = first_directions[i] + np.arange(DIRECTIONS) * (FULL_TURN / DIRECTIONS)
        polygons = [_too_near(other, turned[i], gaps[i]) for other in there]
        places = [_nearest_free(polygons, angle) for angle in angles]
        positions[i] = min(places, key=lambda place: _spread([*there, turned[i] + place]))
    motions = [np.eye(4) for _ in plans]
    for i, motion in enumerate(motions):
        motion[:2, :2], motion[:2, 3] = rotation_in_plane(yaws[i]), positions[i]
    return motions


def plan_of(vertices: np.ndarray) -> np.ndarray:
    """Return the corners of the convex hull of points seen from above, (k, 2), counter-clockwise."""
    from scipy.spatial import ConvexHull

    flat = vertices[:, :2]
    return flat[ConvexHull(flat, qhull_options="QJ Pp").vertices]


def _area(plan: np.ndarray) -> float:
    x, y = plan.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


def _spread(plans: list[np.ndarray]) -> float:
    """Return the radius of the circle around the middle of the box of some plans."""
    points = np.concatenate(plans)
    return float(
        np.linalg.norm(points - (points.min(axis=0) + points.max(axis=0)) / 2, axis=1).max()
    )


def _too_near(other: np.ndarray, plan: np.ndarray, gap: float) -> np.ndarray:
    """Return the sides (a, b, c) of the polygon of shifts that put a plan too near another, (k, 3).

    A shift p is in it where a p_x + b p_y + c < 0 for all sides.
    """
    from scipy.spatial import ConvexHull

    between = (other[:, None] - plan[None]).reshape(-1, 2)
    sides = ConvexHull(between, qhull_options="QJ Pp").equations
    return sides - (0.0, 0.0, gap)


def _nearest_free(polygons: list[np.ndarray], angle: float) -> np.ndarray:
    """Return the shift in a direction that is nearest to the origin and in none of the polygons, (2,)."""
    direction = np.array([np.cos(angle), np.sin(angle)])
    within = (_within(sides, direction) for sides in polygons)
    distance = 0.0
    for start, end in sorted(each for each in within if each is not None):
        if start <= distance < end:  # sorted by their starts: none that comes later reaches back
            distance = end
    return distance * direction


def _within(sides: np.ndarray, direction: np.ndarray) -> tuple[float, float] | None:
    """Return between which distances along a direction a ray is in a polygon; None: nowhere."""
    slope, room = sides[:, :2] @ direction, -sides[:, 2]
    if (room[slope == 0] < 0).any():
        return None
    start = float((room[slope < 0] / slope[slope < 0]).max())
    end = float((room[slope > 0] / slope[slope > 0]).min())
    return (start, end) if start < end else None


# Identifies the arrangement in the seeds.
ARRANGEMENT = 201


def load_objects(
    paths: Sequence[Path],
    seed: int,
    size: float | None = None,
    up: str = "auto",
    unit: str = "auto",
) -> Scene:
    """Return a scene of several mesh files, numbered in their order; its box is centered on the origin.

    Args:
        paths: of the files; one may be named several times.
        seed: of the arrangement.
        size: longest side of the longest object [m]: the others keep their proportion to it; None: those of
            the files.
        up: for every file; see `digs_warp.sim.scene.load.load_scene`.
        unit: likewise.

    Raises:
        DigsError: a file that cannot be used, or too many.
    """
    if len(paths) > MOST_OBJECTS:
        raise DigsError(f"--scene: {len(paths)} files, expected at most {MOST_OBJECTS}")
    read = {path: read_mesh(path, None, up, unit) for path in dict.fromkeys(paths)}
    longest = max(each.longest_side for each in read.values())
    if size is not None:
        read = {
            path: each.with_size(each.longest_side * size / longest) for path, each in read.items()
        }
    files = [read[path] for path in paths]
    rng = np.random.default_rng([seed, ARRANGEMENT])
    motions = beside_each_other(files, rng)
    centered = _centering(files, motions)
    return join_scenes(
        *(each.scene(centered @ motion) for each, motion in zip(files, motions, strict=True))
    )


def beside_each_other(files: Sequence[MeshFile], rng: np.random.Generator) -> list[np.ndarray]:
    """Return the motion of each object to its place on the ground z = 0, (4, 4), in its own pose of rest."""
    motions = arrange([plan_of(each.vertices) for each in files], rng)
    for each, motion in zip(files, motions, strict=True):
        motion[2, 3] = -each.vertices[:, 2].min()
    return motions


def _centering(files: Sequence[MeshFile], motions: Sequence[np.ndarray]) -> np.ndarray:
    """Return the shift of the box of all objects to the origin, (4, 4)."""
    points = [
        each.vertices @ motion[:3, :3].T + motion[:3, 3]
        for each, motion in zip(files, motions, strict=True)
    ]
    low = np.min([part.min(axis=0) for part in points], axis=0)
    high = np.max([part.max(axis=0) for part in points], axis=0)
    shift = np.eye(4)
    shift[:3, 3] = -(low + high) / 2
    return shift
