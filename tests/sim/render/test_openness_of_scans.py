"""Of a mesh with many faces, the openness of a node in each cell is measured; it tells that of the others."""

import numpy as np
import pytest
import trimesh

from digs_warp.sim.render import ambient_occlusion
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material, Scene
from reference.plates import scene_of

SKY = Environment(np.ones((16, 32, 3), np.float32))


def measured(scene: Scene) -> np.ndarray:
    renderer = RaycastRenderer(scene, SKY)
    ambient_occlusion.measure_openness(scene, renderer._surface)
    return renderer._surface.openness.numpy()[:, 0]


def test_the_nodes_of_cells_are_as_open_as_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two balls that touch a board of two large faces, and a shell 1.5 cm outside of one of them."""
    parts = [trimesh.creation.icosphere(4, 0.1) for _ in range(2)]
    parts[1].apply_translation((0.2, 0, 0))
    shell = trimesh.creation.icosphere(4, 0.115)
    shell.update_faces(shell.triangles_center[:, 2] > 0.03)
    board = trimesh.creation.box((0.8, 0.6, 0.02))
    board.apply_translation((0.1, 0, -0.11))
    gray = Material("gray", np.full(3, 0.5))
    scene = join_scenes(
        *(scene_of(p.vertices, p.faces, p.vertex_normals, gray) for p in (*parts, shell, board))
    )
    for budget in ("RAY_BUDGET", "CELLS_BUDGET"):
        monkeypatch.setattr(ambient_occlusion, budget, 10**9)
    exact = measured(scene)
    monkeypatch.setattr(ambient_occlusion, "MOST_NODES", 1_000)
    monkeypatch.setattr(ambient_occlusion, "CELLS", 6_000)
    nodes = ambient_occlusion.openness_nodes(scene)
    chosen, _ = ambient_occlusion._cells(scene, nodes)
    assert len(chosen) < 0.6 * len(exact)
    sampled = measured(scene)
    errors = np.abs(sampled - exact)
    assert exact.std() > 0.2
    assert errors.mean() < 0.015 and np.percentile(errors, 95) < 0.08
    # Nodes of large faces are measured themselves.
    of_board = np.unique([scene.faces[-12:], nodes.edges[-12:]])
    assert np.isin(of_board, chosen).all() and errors[of_board].max() < 1e-6
    # The ball under the shell is dark, the shell is not.
    top = scene.vertices[:, 2] > 0.07
    radius = np.linalg.norm(scene.vertices, axis=1)
    under, over = (top & (np.abs(radius - r) < 1e-4) for r in (0.1, 0.115))
    assert sampled[: len(top)][under].max() < 0.2 < 0.7 < sampled[: len(top)][over].min()
