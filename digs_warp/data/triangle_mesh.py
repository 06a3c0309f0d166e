"""A colored triangle mesh in memory, from surface extraction to file and scene writers."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles with a color per vertex, in the world (z up, metres).

    Attributes:
        points_world: vertices [m], shape (n, 3), float32.
        triangles: vertex numbers, counter-clockwise seen from outside, shape (m, 3), int32.
        colors: sRGB values in 0..1 at the vertices, shape (n, 3), float32.
    """

    points_world: np.ndarray
    triangles: np.ndarray
    colors: np.ndarray

    def __post_init__(self) -> None:
        kinds = {"points_world": np.float32, "triangles": np.int32, "colors": np.float32}
        for name, kind in kinds.items():
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), dtype=kind))

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
