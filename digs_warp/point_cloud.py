"""Coloured points: what an initialization hands to the splat seeding."""

from dataclasses import dataclass

import numpy as np

from digs_warp.checks import check_finite, check_shape


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points with colours; the order carries no meaning.

    Attributes:
        points_world: positions [m], shape (n, 3), float32.
        colors: sRGB values in 0..1, shape (n, 3), float32.
    """

    points_world: np.ndarray
    colors: np.ndarray

    def __post_init__(self) -> None:
        points = np.asarray(self.points_world, dtype=np.float32)
        colors = np.asarray(self.colors, dtype=np.float32)
        check_finite("points", check_shape("points", points, (None, 3)))
        check_finite("colors", check_shape("colors", colors, (len(points), 3)))
        object.__setattr__(self, "points_world", points)
        object.__setattr__(self, "colors", colors)

    def __len__(self) -> int:
        return len(self.points_world)

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The corners (minimum, maximum) of the box around the points [m]; needs a point."""
        return self.points_world.min(axis=0), self.points_world.max(axis=0)
