"""Objects that fell in a pile: nothing within another, everything carried, the same for the same seed."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, KDTree

from digs_warp.checks import DigsError
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.scene import drop
from digs_warp.sim.scene.arrange import load_objects
from digs_warp.sim.scene.drop import dropped
from digs_warp.sim.scene.load import MeshFile, read_mesh
from digs_warp.sim.scene.scene import Scene
from reference.mesh_files import save

pytest.importorskip("mujoco", reason="mujoco is not installed")

MESHES = {
    "small": trimesh.creation.box((0.05, 0.06, 0.08)),
    "long": trimesh.creation.box((0.4, 0.05, 0.05)),
    "cube": trimesh.creation.box((0.15, 0.15, 0.15)),
    "tin": trimesh.creation.cylinder(0.05, 0.2),
    "ball": trimesh.creation.icosphere(3, 0.06),
}
MM = 1e-3


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("meshes")
    return [save(folder / f"{name}.glb", mesh) for name, mesh in MESHES.items()]


@pytest.fixture(scope="module")
def files(paths: list[Path]) -> list[MeshFile]:
    return [read_mesh(path) for path in paths]


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    """How deep two hulls are within each other [m]: the widest ball in both; below 0: they are apart."""
    sides = np.concatenate([ConvexHull(a).equations, ConvexHull(b).equations])
    deepest = linprog(
        [0, 0, 0, -1],
        A_ub=np.c_[sides[:, :3], np.ones(len(sides))],
        b_ub=-sides[:, 3],
        bounds=[(None, None)] * 4,
    )
    return 2.0 * float(deepest.x[3])


def points_of(scene: Scene, number: int) -> np.ndarray:
    return scene.vertices[np.unique(scene.faces[scene.face_objects == number])].astype(float)


@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_within_another_and_everything_is_carried(
    seed: int, files: list[MeshFile]
) -> None:
    motions = dropped(files, np.random.default_rng(seed))
    placed = [
        each.vertices @ motion[:3, :3].T + motion[:3, 3]
        for each, motion in zip(files, motions, strict=True)
    ]
    lowest = np.array([points[:, 2].min() for points in placed])
    assert lowest.min() == pytest.approx(0.0, abs=1e-9)
    touching = lowest < 0.1 * MM
    for i, j in combinations(range(len(placed)), 2):
        depth = overlap(placed[i], placed[j])
        assert depth < 0.1 * MM
        if depth > -0.1 * MM:
            touching[[i, j]] = True
    assert touching.all()
    for motion in motions:
        np.testing.assert_allclose(motion[:3, :3] @ motion[:3, :3].T, np.eye(3), atol=1e-9)
        assert np.linalg.det(motion[:3, :3]) > 0


def test_objects_lie_on_each_other(files: list[MeshFile]) -> None:
    """Boards that fall on boards: most of them are off the ground."""
    boards = [files[1]] * 8
    lifted = 0
    for seed in range(3):
        for motion in dropped(boards, np.random.default_rng(seed)):
            points = files[1].vertices @ motion[:3, :3].T + motion[:3, 3]
            lifted += int(points[:, 2].max() > 60 * MM)
    assert lifted >= 6


def test_the_scene_holds_the_pile(paths: list[Path]) -> None:
    config = SimulateConfig(scene=tuple(paths), arrange="drop", seed=4)
    scene = load_inputs(config).scene
    np.testing.assert_array_equal(scene.vertices, load_inputs(config).scene.vertices)
    other = load_objects(paths, 5, falling=True)
    assert np.abs(scene.vertices - other.vertices).max() > 10 * MM
    for number, each in enumerate(scene.objects, start=1):
        mesh = trimesh.load(paths[number - 1], force="mesh")
        assert isinstance(mesh, trimesh.Trimesh)
        there = trimesh.transform_points(mesh.vertices, each.world_from_mesh)
        points = points_of(scene, number)
        assert KDTree(points).query(there)[0].max() < 1e-6
        np.testing.assert_allclose(np.ptp(points, axis=0), each.size, atol=1e-6)


def test_what_does_not_settle_is_named(
    files: list[MeshFile], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(drop, "LONGEST_SETTLING", 0.0)
    dropped(files, np.random.default_rng(0))
    assert "--arrange drop: the objects still move after" in caplog.text


def test_a_sheet_is_refused(tmp_path: Path) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1.0]])
    sheet = save(tmp_path / "sheet.glb", trimesh.Trimesh(corners, [[0, 1, 2]]))
    with pytest.raises(DigsError, match=r"mesh '.*sheet.glb' is flat"):
        load_objects([sheet], 0, falling=True)
