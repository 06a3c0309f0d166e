"""A colored triangle mesh in memory, from surface extraction to file and scene writers."""

from dataclasses import dataclass

import numpy as np

from digs_warp.checks import DigsError, check_finite, check_shape


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles with a color per vertex, in the world (z up, metres).

    Attributes:
        points_world: vertices [m], shape (n, 3), float32.
        triangles: vertex numbers, counter-clockwise seen from outside, shape (m, 3), int32.
        colors: sRGB values in 0..1 at the vertices, shape (n, 3), float32.

    Raises:
        DigsError: arrays of other shapes, values that are not finite, vertex numbers out of range.
    """

    points_world: np.ndarray
    triangles: np.ndarray
    colors: np.ndarray

    def __post_init__(self) -> None:
        points = np.ascontiguousarray(self.points_world, dtype=np.float32)
        triangles = np.ascontiguousarray(self.triangles, dtype=np.int32)
        colors = np.ascontiguousarray(self.colors, dtype=np.float32)
        check_finite("mesh points", check_shape("mesh points", points, (None, 3)))
        check_finite("mesh colors", check_shape("mesh colors", colors, (len(points), 3)))
        check_shape("mesh triangles", triangles, (None, 3))
        if triangles.size and not 0 <= triangles.min() <= triangles.max() < len(points):
            raise DigsError(
                f"mesh triangles: vertex numbers {triangles.min()} to {triangles.max()}, expected 0 to "
                f"{len(points) - 1}"
            )
        object.__setattr__(self, "points_world", points)
        object.__setattr__(self, "triangles", triangles)
        object.__setattr__(self, "colors", colors)

    def __len__(self) -> int:
        """The number of triangles."""
        return len(self.triangles)

    def normals(self) -> np.ndarray:
        """Return unit normals at the vertices, weighted by area, outwards, shape (n, 3), float32."""
        corners = self.points_world[self.triangles].astype(np.float64)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        sums = np.zeros((len(self.points_world), 3))
        for corner in range(3):
            np.add.at(sums, self.triangles[:, corner], normals)
        lengths = np.linalg.norm(sums, axis=1, keepdims=True)
        up = (0.0, 0.0, 1.0)  # vertices of triangles without area
        units = np.where(lengths > 0, sums / np.where(lengths > 0, lengths, 1.0), up)
        return units.astype(np.float32)
