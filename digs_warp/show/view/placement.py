"""Where things stand on the page: moved to the origin and scaled, side by side, and cut by a box.

Browsers get covariances as 16-bit floats, whose smallest step is 6e-8: a Gaussian of a millimetre has one of
1e-6 in metres, and would lose its shape. Scenes are also drawn between fixed near and far planes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.pipeline.scene_files import check_target, write_scene_file
from digs_warp.show.film.camera_path import Subject, with_thin_parts


@dataclass(frozen=True)
class Box:
    """A box on the page, along its axes [page units]."""

    center: tuple[float, float, float]
    size: tuple[float, float, float]

    def holds(self, points_page: np.ndarray) -> np.ndarray:
        """Return which points, shape (n, 3), lie in it, shape (n,), bool."""
        away = np.abs(points_page - np.array(self.center, np.float32))
        return np.all(away <= 0.5 * np.array(self.size, np.float32), axis=1)


def save_cropped(target: Path, gaussians: Gaussians, keep: np.ndarray, source: str) -> str:
    """Write the Gaussians that are kept, in the world of their source; return what was done.

    Args:
        target: the file; its suffix decides the format.
        gaussians: in the world.
        keep: which of them, shape (n,), bool.
        source: where they come from, for a USD scene.

    Raises:
        DigsError: the suffix is unknown, the file exists, or nothing is kept.
    """
    check_target(target)
    if target.exists():
        raise DigsError(f"'{target}' exists; choose another name")
    if not keep.any():
        raise DigsError("no Gaussian lies in the box; move or enlarge it")
    result = Reconstruction(gaussians=gaussians.select(keep))
    write_scene_file(target, result, Path(source))
    return f"{target}: {np.count_nonzero(keep):,} of {len(keep):,} Gaussians"


# Most of a scene lies within this distance of the origin [page units].
RADIUS = 4.0

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
        low, high = np.percentile(points_world, [2, 98], axis=0)
        center = 0.5 * (low + high)
        radius = float(np.percentile(np.linalg.norm(points_world - center, axis=1), 98))
        shown = with_thin_parts(points_world, Subject(center, radius))
        scale = RADIUS / (shown.radius or 1.0)
        return Placement(shown.center_world, scale, np.asarray(offset, dtype=np.float64))

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


def side_by_side(count: int) -> list[tuple[float, float, float]]:
    """Return the offset of each of ``count`` contents on the page, in a row along x."""
    middle = (count - 1) / 2
    return [(SPACING * RADIUS * (number - middle), 0.0, 0.0) for number in range(count)]
