"""Where things stand on the page: moved to the origin and scaled, several contents side by side.

Browsers get covariances as 16-bit floats, whose smallest step is 6e-8: a Gaussian of a millimetre has one of
1e-6 in metres, and would lose its shape. Scenes are also drawn between fixed near and far planes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.data.gaussians import Gaussians

# Most of a scene lies within this distance of the origin [page units].
RADIUS = 4.0

# Thin parts that stick out, such as a handle, have few Gaussians and are shown, too, up to this many times
# the radius of most of the scene; what is farther away is a stray.
REACH = 1.6

# Distance between contents side by side, in radii.
SPACING = 2.2


@dataclass(frozen=True, eq=False)
class Placement:
    """The page's coordinates: ``page = scale * (world - center_world) + offset``.

    Attributes:
        center_world: what stands at ``offset`` [m], shape (3,).
        scale: page units per metre.
        offset: on the page, shape (3,).
    """

    center_world: np.ndarray
    scale: float
    offset: np.ndarray

    @staticmethod
    def of(points_world: np.ndarray, offset: Sequence[float] = (0.0, 0.0, 0.0)) -> "Placement":
        """Return the placement that shows all points but strays within `RADIUS`; there is at least one."""
        center, radius = _ball(points_world, 98.0)
        near = np.linalg.norm(points_world - center, axis=1) <= REACH * radius
        center, radius = _ball(points_world[near], 99.9)
        return Placement(center, RADIUS / (radius or 1.0), np.asarray(offset, dtype=np.float64))

    def at(self, offset: Sequence[float]) -> "Placement":
        """Return the same scale somewhere else on the page."""
        return Placement(self.center_world, self.scale, np.asarray(offset, dtype=np.float64))

    def points(self, points_world: np.ndarray) -> np.ndarray:
        """Return points on the page, shape (n, 3), float32."""
        moved = self.scale * (np.asarray(points_world, np.float64) - self.center_world)
        return (moved + self.offset).astype(np.float32)

    def gaussians(self, gaussians: Gaussians) -> Gaussians:
        """Return Gaussians on the page; neither scaling nor moving changes their color in any direction."""
        log_scales = gaussians.log_scales + np.float32(np.log(self.scale))
        return replace(gaussians, means=self.points(gaussians.means), log_scales=log_scales)


def _ball(points: np.ndarray, percent: float) -> tuple[np.ndarray, float]:
    """Return center and radius of a ball that holds this share of the points."""
    low, high = np.percentile(points, [100.0 - percent, percent], axis=0)
    center = 0.5 * (low + high)
    return center, float(np.percentile(np.linalg.norm(points - center, axis=1), percent))


def side_by_side(count: int) -> list[tuple[float, float, float]]:
    """Return the offset of each of ``count`` contents on the page, in a row along x."""
    middle = (count - 1) / 2
    return [(SPACING * RADIUS * (number - middle), 0.0, 0.0) for number in range(count)]
