"""Large scans are loaded with memory in proportion to what is kept, not to all steps at once."""

import tracemalloc
from pathlib import Path

import numpy as np

from digs_warp.sim.scene.load import load_scene

SIDE = 400
# All steps at once took 1,070.
MOST_BYTES_PER_TRIANGLE = 600


def write_grid(path: Path) -> int:
    """Write a wavy sheet as binary PLY; return its triangles."""
    x, y = np.meshgrid(np.linspace(0, 1, SIDE + 1), np.linspace(0, 1, SIDE + 1), indexing="ij")
    vertices = np.stack([x, y, 0.1 * np.sin(9 * x) * np.cos(7 * y)], axis=-1).reshape(-1, 3)
    cell = np.arange(SIDE * SIDE)
    corner = cell // SIDE * (SIDE + 1) + cell % SIDE
    below = corner + SIDE + 1
    faces = np.concatenate(
        [
            np.stack([corner, corner + 1, below], axis=1),
            np.stack([corner + 1, below + 1, below], axis=1),
        ]
    )
    rows = np.zeros(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + vertices.astype("<f4").tobytes() + rows.tobytes())
    return len(faces)


def test_a_large_scan_takes_little_memory(tmp_path: Path):
    import trimesh  # noqa: F401  (not counted)

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
