"""Of a mesh with many faces, the openness of a part of the nodes is measured; it tells that of the others."""

import numpy as np
import pytest
import trimesh

from digs_warp.sim.render import ambient_occlusion, ambient_occlusion_samples
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material, Scene
from reference.plates import scene_of

SKY = Environment(np.ones((16, 32, 3), np.float32))


GRAY = Material("gray", np.full(3, 0.5))


def balls_on_a_board() -> Scene:
    """Two balls that touch a board of two large faces, and a shell 1.5 cm outside of one of them."""
    parts = [trimesh.creation.icosphere(4, 0.1) for _ in range(2)]
    parts[1].apply_translation((0.2, 0, 0))
    shell = trimesh.creation.icosphere(4, 0.115)
    shell.update_faces(shell.triangles_center[:, 2] > 0.03)
    board = trimesh.creation.box((0.8, 0.6, 0.02))
    board.apply_translation((0.1, 0, -0.11))
    whole = (*parts, shell, board)
    return join_scenes(
        *(scene_of(part.vertices, part.faces, part.vertex_normals, GRAY) for part in whole)
    )


def measured(scene: Scene) -> np.ndarray:
    renderer = RaycastRenderer(scene, SKY)
    ambient_occlusion.measure_openness(scene, renderer._surface)
    return renderer._surface.openness.numpy()


def test_the_nodes_between_samples_are_as_open_as_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = balls_on_a_board()
    for budget in ("RAY_BUDGET", "SAMPLES_BUDGET"):
        monkeypatch.setattr(ambient_occlusion, budget, 10**9)
    exact = measured(scene)
    taken = []
    choose = ambient_occlusion_samples.choose_samples
    monkeypatch.setattr(ambient_occlusion, "MOST_NODES", 1_000)
    monkeypatch.setattr(ambient_occlusion_samples, "CELLS", 6_000)
    monkeypatch.setattr(
        ambient_occlusion, "choose_samples", lambda *args: taken.append(choose(*args)) or taken[-1]
    )
    sampled = measured(scene)
    (samples,) = taken
    assert len(samples.measured) < 0.6 * len(exact)
    np.testing.assert_allclose(sampled[samples.measured], exact[samples.measured], atol=1e-6)
    errors = np.abs(sampled - exact)[:, 0]
    assert exact[:, 0].std() > 0.2
    assert errors.mean() < 0.015 and np.percentile(errors, 95) < 0.08
    # The ball under the shell is dark, the shell is not.
    top = scene.vertices[:, 2] > 0.07
    radius = np.linalg.norm(scene.vertices, axis=1)
    count = len(scene.vertices)
    under, over = (top & (np.abs(radius - r) < 1e-4) for r in (0.1, 0.115))
    assert sampled[:count][under, 0].max() < 0.2 < 0.7 < sampled[:count][over, 0].min()


def test_nodes_of_large_faces_are_measured_themselves() -> None:
    scene = balls_on_a_board()
    nodes = ambient_occlusion.openness_nodes(scene)
    of_faces = np.concatenate([scene.faces, nodes.edges], axis=1)
    samples = ambient_occlusion_samples.choose_samples(scene, nodes.points, nodes.normals, of_faces)
    board = of_faces[-12:].reshape(-1)
    assert np.isin(board, samples.measured).all()
    assert not np.isin(board, samples.measured[samples.around]).any()
