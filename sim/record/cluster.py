"""Several objects beside each other on the ground: close together, turned at random, without overlap.

Each object is taken for the upright prism over the convex hull of its plan. Two prisms are apart if no vector
between a corner of one and a corner of the other is within the gap of the hull of all such vectors (their
Minkowski difference), which is exact for convex plans.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.geometry.rigid import rotation_in_plane

# Distance between neighbors, as a share of the median length of the plans; drawn for each object.
GAPS = (0.03, 0.15)

# Directions in which a place for an object is looked for.
DIRECTIONS = 48

FULL_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Spot:
    """Where an object goes: turned about z [rad], then moved to (x, y) [m]."""

    yaw: float
    position: np.ndarray

    @property
    def world_from_own(self) -> np.ndarray:
        """The motion from where the object stands alone, shape (4, 4)."""
        motion = np.eye(4)
        motion[:2, :2] = rotation_in_plane(self.yaw)
        motion[:2, 3] = self.position
        return motion


def arrange(plans: Sequence[np.ndarray], rng: np.random.Generator) -> list[Spot]:
    """Return a spot for each object: the largest first, each next one where the cluster stays smallest.

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
    return [Spot(float(yaws[i]), positions[i]) for i in range(len(plans))]


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
