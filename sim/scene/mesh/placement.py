"""Where a mesh file goes in the world: its unit, the axis that points up, its center at the origin.

glTF is in metres by its specification (section 3.6, "Coordinate System and Units"). The other formats have no
unit, so it is guessed from the size: it is what a handheld camera can record.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from digs_warp.geometry.rigid import rigid

Unit = Literal["m", "cm", "mm", "in", "auto"]
METRES_PER_UNIT = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}

# Longest sides [m] of what people record with a handheld camera. Of the units without this file's, the first
# that puts it there is taken; centimetres and inches would be ambiguous, so they have to be asked for.
RECORDED_SIZES = (0.02, 20.0)
GUESSED_UNITS = ("m", "mm")

# World_from_mesh rotations by the axis of the file that points up.
ROTATION_BY_UP_AXIS = {
    "x": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
}


@dataclass(frozen=True)
class Scale:
    """Metres per unit of a mesh file, and in words how they were found."""

    metres_per_unit: float
    origin: str


@dataclass(frozen=True, eq=False)
class Placement:
    """How a mesh file was placed in the world.

    Attributes:
        world_from_mesh: rotation, scale and translation from coordinates of the file to the world [m],
            shape (4, 4), float64.
        up: axis of the file that points up: "x", "y" or "z".
        scale: metres per unit.
        turned: by how much the object was turned from the file's pose, so that it rests [degrees].
    """

    world_from_mesh: np.ndarray
    up: str
    scale: Scale
    turned: float = 0.0


def stated_scale(size: float | None, unit: str, extent: np.ndarray, is_gltf: bool) -> Scale | None:
    """Return the scale that the user or the format states; None if neither does.

    Args:
        size: longest side that was asked for [m]; None: that of the file.
        unit: key of `METRES_PER_UNIT` that was asked for, or "auto".
        extent: sides of the bounding box in units of the file, shape (3,).
        is_gltf: whether the format is in metres.
    """
    if size is not None:
        return Scale(size / float(extent.max()), f"scaled to {size:g} m (--object-size)")
    if unit != "auto":
        return Scale(METRES_PER_UNIT[unit], f"in {unit} (--mesh-unit)")
    return Scale(1.0, "glTF is in metres") if is_gltf else None


def guessed_scale(extent: np.ndarray, kind: str) -> Scale:
    """Return the scale of a file without a unit: the first of `GUESSED_UNITS` with a plausible size.

    Args:
        extent: sides of the bounding box in units of the file, shape (3,).
        kind: name of the format, for the words.
    """
    longest = float(extent.max())
    low, high = RECORDED_SIZES
    plausible = [u for u in GUESSED_UNITS if low <= longest * METRES_PER_UNIT[u] <= high]
    # Nothing is plausible below 2 cm in metres or above 20 m in millimetres: the nearest one.
    unit = plausible[0] if plausible else ("m" if longest < low else "mm")
    sides = " x ".join(f"{side:.3g}" for side in extent)
    return Scale(
        METRES_PER_UNIT[unit],
        f"{kind} has no unit: {sides} taken as {unit}; --mesh-unit {'|'.join(METRES_PER_UNIT)} says "
        "otherwise",
    )


def place(vertices: np.ndarray, up: str, scale: Scale, turn: np.ndarray | None = None) -> Placement:
    """Return the placement that turns ``up`` to z and puts the middle of the box at the origin.

    Args:
        vertices: those that the faces use, in the file, shape (n, 3).
        up: axis of the file that points up.
        scale: metres per unit.
        turn: rotation in the world after that, shape (3, 3); None: none.
    """
    turn = np.eye(3) if turn is None else turn
    linear = scale.metres_per_unit * turn @ ROTATION_BY_UP_AXIS[up]
    turned = vertices @ linear.T
    middle = (turned.min(axis=0) + turned.max(axis=0)) / 2
    angle = np.rad2deg(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
    return Placement(rigid(linear, -middle), up, scale, float(angle))
