"""The models of a BOP data set: the recorded mesh files in millimetres, and their sizes.

See https://github.com/thodan/bop_toolkit/blob/master/docs/bop_datasets_format.md, "3D object models".
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.images import to_uint8
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.formats.captures.bop import model_ids, model_placement
from digs_warp.formats.captures.recording import MM_PER_METRE
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.record.files import to_json, write_atomically

MODELS = "models"

# Rows of the matrix of distances at a time.
ROWS = 512


def write_bop_models(capture: Capture, surfaces: Sequence[TriangleMesh], folder: Path) -> None:
    """Write models/obj_000001.ply and so on, and models/models_info.json, of the data set in ``folder``.

    Args:
        capture: that `digs_warp.formats.captures.bop.write_bop` wrote to ``folder``.
        surfaces: its objects, in the world.
        folder: of the data set.
    """
    infos: dict[int, dict[str, float]] = {}
    for index, (number, surface) in enumerate(zip(model_ids(capture), surfaces, strict=True)):
        if number not in infos:
            model_from_world = invert_rigid(model_placement(capture, index))
            infos[number] = _write_model(surface, model_from_world, folder, number)
    write_atomically(folder / MODELS / "models_info.json", to_json(infos).encode())


def _write_model(
    surface: TriangleMesh, model_from_world: np.ndarray, folder: Path, number: int
) -> dict[str, float]:
    """Write one model; return its size."""
    import trimesh

    points = MM_PER_METRE * surface.points_world.astype(np.float64)
    points = points @ model_from_world[:3, :3].T + model_from_world[:3, 3]
    colored = trimesh.Trimesh(
        points, surface.triangles, vertex_colors=to_uint8(surface.colors), process=False
    )
    data = colored.export(file_type="ply", vertex_normal=True)
    assert isinstance(data, bytes)
    write_atomically(folder / MODELS / f"obj_{number:06d}.ply", data)
    low, high = points.min(axis=0), points.max(axis=0)
    info: dict[str, float] = {"diameter": diameter(points)}
    info |= {f"min_{axis}": float(value) for axis, value in zip("xyz", low, strict=True)}
    info |= {f"size_{axis}": float(value) for axis, value in zip("xyz", high - low, strict=True)}
    return info


def diameter(points: np.ndarray) -> float:
    """Return the largest distance between two of the points, shape (n, 3)."""
    from scipy.spatial import ConvexHull
    from scipy.spatial.distance import cdist

    # Only corners of the hull are that far apart. Joggled, because a flat mesh has no hull.
    corners = points[ConvexHull(points, qhull_options="QJ").vertices] if len(points) > 4 else points
    parts = (corners[i : i + ROWS] for i in range(0, len(corners), ROWS))
    return max(float(cdist(part, corners).max()) for part in parts)
