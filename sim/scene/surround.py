"""The surround's shape: a convex region whose boundary shows the environment."""

from dataclasses import dataclass

import numpy as np

# Where panoramas are taken [m]: from a tripod at eye level, and not right above the object: straight down
# they show the tripod or its retouched place, and their texels become ever narrower.
PHOTOGRAPHER_HEIGHT = 1.6
PHOTOGRAPHER_ASIDE = 1.0

# Height of a room over its width.
ROOM_HEIGHT = 0.7


@dataclass(frozen=True)
class Surround:
    """A sphere, a sphere cut by a floor (dome), or a box (room); z is up, metres.

    A place on the boundary shows what the panorama shows in its direction from ``center``; in a room, in the
    direction that it would have in a cube.

    Attributes:
        center: middle of sphere or box, and where the panorama was taken, (x, y, z).
        radius: of the sphere; of a room: half its width.
        floor: height of the floor; None: the whole sphere.
        is_room: whether the boundary is a box.
    """

    center: tuple[float, float, float]
    radius: float
    floor: float | None = None
    is_room: bool = False

    @staticmethod
    def sphere(radius: float) -> "Surround":
        """Return a sphere around the origin."""
        return Surround((0.0, 0.0, 0.0), radius)

    @staticmethod
    def dome(floor: float, radius: float) -> "Surround":
        """Return a sphere around a photographer's camera above a floor; its radius exceeds that height."""
        return Surround((PHOTOGRAPHER_ASIDE, 0.0, floor + PHOTOGRAPHER_HEIGHT), radius, floor)

    @staticmethod
    def room(floor: float, half_width: float) -> "Surround":
        """Return a square room on a floor, around the z axis."""
        height = floor + ROOM_HEIGHT * half_width
        return Surround((0.0, 0.0, height), half_width, floor, is_room=True)

    @property
    def half_size(self) -> np.ndarray:
        """Half the sides of a room, (3,)."""
        return self.radius * np.array([1.0, 1.0, ROOM_HEIGHT])

    def holds(self, point: np.ndarray) -> bool:
        """Whether a point, (3,), is inside."""
        away = point - np.array(self.center)
        if self.is_room:
            return bool((np.abs(away) < self.half_size).all())
        above = self.floor is None or point[2] > self.floor
        return bool(above and np.linalg.norm(away) < self.radius)
