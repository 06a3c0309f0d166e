"""The sparse points of a recording: a PLY file with x, y, z, red, green and blue, as nerfstudio has it."""

import logging
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.images import to_uint8
from digs_warp.data.ply_table import read_ply_header, read_table, write_vertices
from digs_warp.data.point_cloud import PointCloud

logger = logging.getLogger(__name__)

POSITION, COLOR = ("x", "y", "z"), ("red", "green", "blue")


def write_points(path: Path, cloud: PointCloud) -> None:
    """Write positions and colors in the order that OpenSplat insists on."""
    kinds = [(axis, "<f4") for axis in POSITION] + [(color, "u1") for color in COLOR]
    blocks = np.empty(len(cloud), dtype=[("position", "<f4", 3), ("color", "u1", 3)])
    blocks["position"], blocks["color"] = cloud.points_world, to_uint8(cloud.colors)
    write_vertices(path, blocks.view(kinds))


def read_points(path: Path) -> PointCloud:
    """Read a file with positions, and colors in 8 bits if it has them (else gray).

    Positions that are not finite are left out, with a warning.

    Raises:
        DigsError: no PLY file, or no positions.
    """
    table = read_table(path, read_ply_header(path), "vertex")
    names = table.dtype.names or ()
    if not set(POSITION) <= set(names):
        raise DigsError(f"points '{path}': properties {', '.join(names)}, expected x, y and z")
    positions = np.stack([table[axis] for axis in POSITION], axis=1).astype(np.float32)
    colors = np.full(positions.shape, 0.5, np.float32)
    if all(name in names and table[name].dtype == np.uint8 for name in COLOR):
        colors = np.stack([table[name] for name in COLOR], axis=1) / np.float32(255)
    sound = np.all(np.isfinite(positions), axis=1, keepdims=False)
    if lost := int(np.count_nonzero(~sound)):
        logger.warning(
            "points '%s': %d of %d are not finite and are left out", *(path, lost, len(positions))
        )
    return PointCloud(positions[sound], colors[sound])
