"""One object of a simulated recording, as transforms.json names it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from digs_warp.record.fields import is_number, is_text

# Rows of numbers; a tuple, so that facts can be compared.
Matrix = tuple[tuple[float, ...], ...]

# By how much the axes of a placement may miss equal lengths and right angles.
SIMILARITY_TOLERANCE = 1e-6


@dataclass(frozen=True)
class PlacedObject:
    """An object of a recording.

    Attributes:
        name: for people; several objects may have the same.
        mesh: path of its file as the recorder was given it; None: made by code.
        size: sides of its bounding box along x, y and z of the world [m].
        world_from_mesh: rotation, scale and translation from the coordinates of the file to the world [m],
            rows of a (4, 4) matrix; the identity if it was made by code.
    """

    name: str
    mesh: str | None
    size: tuple[float, float, float]
    world_from_mesh: Matrix

    @staticmethod
    def from_json(facts: dict[str, Any]) -> "PlacedObject":
        """Return what `as_json` wrote, checked by `is_list_of_objects`."""
        width, depth, height = (float(side) for side in facts["size"])
        placement = matrix_rows(np.array(facts["world_from_mesh"], np.float64))
        return PlacedObject(facts["name"], facts.get("mesh"), (width, depth, height), placement)

    def as_json(self) -> dict[str, Any]:
        """Return the object in the form of transforms.json."""
        mesh = {} if self.mesh is None else {"mesh": self.mesh}
        rows = [list(row) for row in self.world_from_mesh]
        return {"name": self.name, **mesh, "size": list(self.size), "world_from_mesh": rows}


def matrix_rows(matrix: np.ndarray) -> Matrix:
    """Return a matrix in a form that can be compared."""
    return tuple(map(tuple, matrix.tolist()))


def is_list_of_objects(value: Any) -> bool:
    """Whether every entry of a list is an object of a recording."""
    return isinstance(value, list) and bool(value) and all(map(_is_object, value))


def _is_object(value: Any) -> bool:
    if not isinstance(value, dict) or not is_text(value.get("name")):
        return False
    size, mesh = value.get("size"), value.get("mesh")
    return (
        (mesh is None or is_text(mesh))
        and isinstance(size, list)
        and len(size) == 3
        and all(is_number(side) and side >= 0 for side in size)
        and is_placement(value.get("world_from_mesh"))
    )


def is_placement(value: Any) -> bool:
    """Whether it is a rotation, a scale and a translation, (4, 4)."""
    is_4x4 = (
        isinstance(value, list)
        and [len(row) if isinstance(row, list) else 0 for row in value] == [4] * 4
    )
    if not is_4x4 or not all(is_number(x) for row in value for x in row):
        return False
    matrix = np.array(value, np.float64)
    if not np.isfinite(matrix).all() or matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        return False
    volume = np.linalg.det(matrix[:3, :3])
    axes = matrix[:3, :3] / np.cbrt(volume) if volume > 0 else np.zeros((3, 3))
    return bool(np.abs(axes @ axes.T - np.eye(3)).max() < SIMILARITY_TOLERANCE)
