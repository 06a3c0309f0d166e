"""Objects that are turned: geometry, pose and size go together."""

from pathlib import Path

import numpy as np

from digs_warp.sim.scene.load import load_scene

PYRAMID = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def test_vertices_normals_and_pose_turn_counterclockwise(tmp_path: Path) -> None:
    path = tmp_path / "pyramid.obj"
    path.write_text(PYRAMID)
    scene = load_scene(path)
    after = scene.turned(np.pi / 6)
    x, y, z = scene.vertices.T.astype(np.float64)
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    np.testing.assert_allclose(
        after.vertices, np.stack([c * x - s * y, s * x + c * y, z], 1), atol=1e-6
    )
    x, y, z = scene.normals.T.astype(np.float64)
    np.testing.assert_allclose(
        after.normals, np.stack([c * x - s * y, s * x + c * y, z], 1), atol=1e-6
    )

    (thing,) = after.objects
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 2)], np.float64)
    placed = corners @ thing.world_from_mesh[:3, :3].T + thing.world_from_mesh[:3, 3]
    there = np.unique(after.vertices.round(5), axis=0)
    np.testing.assert_allclose(np.unique(placed.round(5), axis=0), there, atol=2e-5)
    np.testing.assert_allclose(thing.size, np.ptp(after.vertices, axis=0), atol=1e-6)
    assert np.abs(thing.size - np.ptp(scene.vertices, axis=0)).max() > 0.1
