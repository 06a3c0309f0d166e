"""Large scans are loaded with memory in proportion to what is kept, not to all steps at once."""

import tracemalloc
from pathlib import Path

import numpy as np
import trimesh

from digs_warp.sim.scene.load import load_scene
from reference.mesh_files import save

SIDE = 400
# All steps at once took 1,070.
MOST_BYTES_PER_TRIANGLE = 600


def write_grid(path: Path) -> int:
    """Write a wavy sheet as binary PLY; return its triangles."""
    x, y = np.meshgrid(np.linspace(0, 1, SIDE + 1), np.linspace(0, 1, SIDE + 1), indexing="ij")
    vertices = np.stack([x, y, 0.1 * np.sin(9 * x) * np.cos(7 * y)], axis=-1).reshape(-1, 3)
    corner = np.arange(len(vertices)).reshape(SIDE + 1, SIDE + 1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.concatenate([np.stack([a, b, d], -1), np.stack([b, c, d], -1)]).reshape(-1, 3)
    save(path, trimesh.Trimesh(vertices, faces, process=False))
    return len(faces)


def test_a_large_scan_takes_little_memory(tmp_path: Path):
    count = write_grid(tmp_path / "scan.ply")
    tracemalloc.start()
    try:
        scene = load_scene(tmp_path / "scan.ply")
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(scene.faces) == count
    assert peak < MOST_BYTES_PER_TRIANGLE * count
    np.testing.assert_allclose(np.linalg.norm(scene.normals, axis=1), 1, atol=1e-5)
