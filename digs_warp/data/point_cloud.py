"""Colored points, from which the first Gaussians are made: as arrays, and as the PLY file of a recording."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError, check_finite, check_shape
from digs_warp.data.images import to_uint8
from digs_warp.data.ply_table import read_ply_header, read_table, write_tables
from digs_warp.record.arrays import open_arrays, write_arrays
from digs_warp.words import cut, first_few

logger = logging.getLogger(__name__)

FIELDS = ("points_world", "colors")
# What some clouds know of their points, and what is so of all of them in a cloud without it.
USUAL: dict[str, bool | float] = {"guessed": False, "hidden": False, "agreement": 1.0}


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points with colors; the order carries no meaning.

    Attributes:
        points_world: positions [m], shape (n, 3), float32.
        colors: sRGB values in 0..1, shape (n, 3), float32.
        guessed: which points were put where no view measured anything, shape (n,), bool; None: none.
        hidden: which points no view can see, behind what all of them measured, shape (n,), bool; None: none.
        agreement: which share of the views near a point agree with it, in 0..1, shape (n,), float32; None:
            all of them.
    """

    points_world: np.ndarray
    colors: np.ndarray
    guessed: np.ndarray | None = None
    hidden: np.ndarray | None = None
    agreement: np.ndarray | None = None

    def __post_init__(self) -> None:
        count = len(self.points_world)
        shapes = {"points_world": (None, 3), "colors": (count, 3)}
        for name, values in self._arrays.items():
            kind = bool if USUAL.get(name) is False else np.float32
            array = check_shape(name, np.asarray(values, kind), shapes.get(name, (count,)))
            object.__setattr__(self, name, check_finite(name, array))

    @property
    def _arrays(self) -> dict[str, np.ndarray]:
        every = {name: getattr(self, name) for name in (*FIELDS, *USUAL)}
        return {name: values for name, values in every.items() if values is not None}

    def __len__(self) -> int:
        return len(self.points_world)

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The corners (minimum, maximum) of the box around the points [m]; needs a point."""
        return self.points_world.min(axis=0), self.points_world.max(axis=0)

    def select(self, keep: np.ndarray) -> "PointCloud":
        """Return the points at ``keep``, a bool mask or indices."""
        return PointCloud(**{name: values[keep] for name, values in self._arrays.items()})

    @staticmethod
    def joined(clouds: "Sequence[PointCloud]") -> "PointCloud":
        """Return the points of one or more clouds."""
        known = [name for name in (*FIELDS, *USUAL) if any(name in c._arrays for c in clouds)]
        return PointCloud(
            **{
                name: np.concatenate(
                    [c._arrays.get(name, np.full(len(c), USUAL.get(name))) for c in clouds]
                )
                for name in known
            }
        )

    def save(self, path: Path) -> None:
        """Write an ``.npz`` with one array per field, or a PLY file of positions and colors, complete."""
        if Path(path).suffix.lower() == ".ply":
            write_points(path, self)
            return
        write_arrays(path, self._arrays)

    @staticmethod
    def load(path: Path) -> "PointCloud":
        """Read a file that `save` wrote.

        Raises:
            DigsError: the file is missing, truncated, or lacks a field.
        """
        if Path(path).suffix.lower() == ".ply":
            return read_points(path)
        with open_arrays(path, "points", FIELDS) as arrays:
            known = [name for name in (*FIELDS, *USUAL) if name in arrays]
            return PointCloud(**{name: arrays[name] for name in known})


# Floats above this are colors of 0 to 255.
MOST_FLOAT = 2.0

POSITION, COLOR = ("x", "y", "z"), ("red", "green", "blue")


def write_points(path: Path, cloud: PointCloud) -> None:
    """Write positions and colors in the order that OpenSplat insists on."""
    kinds = [(axis, "<f4") for axis in POSITION] + [(color, "u1") for color in COLOR]
    blocks = np.empty(len(cloud), dtype=[("position", "<f4", 3), ("color", "u1", 3)])
    blocks["position"], blocks["color"] = cloud.points_world, to_uint8(cloud.colors)
    write_tables(path, {"vertex": blocks.view(kinds)})


def read_points(path: Path, offset: np.ndarray | float = 0.0, scale: float = 1.0) -> PointCloud:
    """Read a file with positions, and colors, whole numbers or 0 to 1, if it has them (else gray).

    Positions that are not finite are left out, with a warning.

    Args:
        path: of the file.
        offset: what is taken off the positions before they are rounded to float32, shape (3,) [m].
        scale: what they are divided by before.

    Raises:
        DigsError: no PLY file, or no positions.
    """
    table = read_table(path, read_ply_header(path), "vertex")
    names = table.dtype.names or ()
    if not set(POSITION) <= set(names):
        raise DigsError(
            f"points '{path}': properties {first_few([*map(cut, names)])}, expected x, y and z"
        )
    positions = np.stack([table[axis] for axis in POSITION], axis=1).astype(np.float64)
    positions = (positions / scale - offset).astype(np.float32)
    if np.any(offset) and table["x"].dtype.itemsize < 8:
        logger.warning("points '%s': floats cannot hold places so far away; write doubles", path)
    colors = np.full(positions.shape, 0.5, np.float32)
    if set(COLOR) <= set(names):
        colors = unit_colors(np.stack([table[name] for name in COLOR], axis=1))
    sound = np.all(np.isfinite(positions), axis=1, keepdims=False)
    if lost := int(np.count_nonzero(~sound)):
        logger.warning(
            "points '%s': %d of %d are not finite and are left out", *(path, lost, len(positions))
        )
    return PointCloud(positions[sound], colors[sound])


def unit_colors(stored: np.ndarray) -> np.ndarray:
    """Return colors of any type as 0 to 1: shares of the largest whole number, or of 255 beside floats."""
    if stored.dtype.kind in "iu":
        top = np.iinfo(stored.dtype).max
    else:
        stored = np.nan_to_num(stored)
        top = 255 if stored.max(initial=0) > MOST_FLOAT else 1
    return np.clip(stored / np.float32(top), 0, 1).astype(np.float32)
