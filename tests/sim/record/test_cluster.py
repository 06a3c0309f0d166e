"""Objects beside each other: apart, close together, on the ground, the same for the same seed."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from digs_warp.checks import DigsError
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.session import prepare_session
from digs_warp.sim.scene.arrange import GAPS, arrange, load_objects, plan_of
from digs_warp.sim.scene.environment import TABLE_HEIGHT, Ground
from digs_warp.sim.scene.scene import FURNITURE
from reference.mesh_files import save

MM = 1e-3
SIZES = {"small": (0.05, 0.06, 0.08), "long": (0.4, 0.05, 0.05), "cube": (0.15, 0.15, 0.15)}


@pytest.fixture
def boxes(tmp_path: Path) -> list[Path]:
    return [
        save(tmp_path / f"{name}.glb", trimesh.creation.box(sides)) for name, sides in SIZES.items()
    ]


def separation(a: np.ndarray, b: np.ndarray) -> float:
    """The largest distance between two convex polygons along the normal of an edge; below 0: they overlap."""
    best = -np.inf
    for one, other in ((a, b), (b, a)):
        edges = np.roll(one, -1, axis=0) - one
        edges = edges[np.linalg.norm(edges, axis=1) > 1e-9]
        for normal in np.stack([edges[:, 1], -edges[:, 0]], axis=1):
            normal = normal / np.linalg.norm(normal)
            best = max(best, (other @ normal).min() - (one @ normal).max())
    return float(best)


@pytest.mark.parametrize("seed", range(3))
def test_plans_are_apart_but_close(seed: int) -> None:
    rng = np.random.default_rng(seed)
    plans = [
        plan_of(rng.normal(size=(12, 3)) * rng.uniform(0.02, 0.3, 3))
        for _ in range(rng.integers(2, 9))
    ]
    spots = arrange(plans, np.random.default_rng(seed))
    placed = [plan @ spot[:2, :2].T + spot[:2, 3] for plan, spot in zip(plans, spots, strict=True)]
    least = GAPS[0] * np.median([np.ptp(plan, axis=0).max() for plan in plans])
    gaps = np.array([separation(a, b) for a, b in combinations(placed, 2)])
    assert gaps.min() >= least * (1 - 1e-9)
    # The circle around all of them is at most twice that of all their areas.
    points = np.concatenate(placed)
    widest = np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    alone = max(np.linalg.norm(plan, axis=1).max() for plan in plans)
    area = sum(np.pi * np.linalg.norm(plan, axis=1).max() ** 2 for plan in plans)
    assert widest < 2 * np.sqrt(area / np.pi) + alone
    np.testing.assert_array_equal(arrange(plans, np.random.default_rng(seed)), spots)


def test_objects_stand_on_one_ground_around_the_origin(boxes: list[Path]) -> None:
    scene, other = (load_objects([*boxes, boxes[0]], seed) for seed in (3, 4))
    assert np.abs(scene.vertices - other.vertices).max() > 0.01
    assert [each.name for each in scene.objects] == ["small", "long", "cube", "small"]
    np.testing.assert_allclose(
        scene.vertices.min(axis=0) + scene.vertices.max(axis=0), 0, atol=1e-7
    )
    ground = scene.vertices[:, 2].min()
    for number, each in enumerate(scene.objects, start=1):
        points = scene.vertices[np.unique(scene.faces[scene.face_objects == number])]
        assert points[:, 2].min() == pytest.approx(ground, abs=1e-7)
        np.testing.assert_allclose(np.ptp(points, axis=0), each.size, atol=1e-7)
        sides = SIZES[each.name]
        assert each.size[2] == pytest.approx(sides[1])  # y up, as in glTF
        assert each.mesh is not None
        mesh = trimesh.load(each.mesh, force="mesh")
        assert isinstance(mesh, trimesh.Trimesh)
        there = trimesh.transform_points(mesh.vertices, each.world_from_mesh)
        assert KDTree(points).query(there)[0].max() < 1e-6
        assert np.linalg.det(each.world_from_mesh[:3, :3]) == pytest.approx(1.0)


@pytest.mark.parametrize("ground", ["floor", "table"])
def test_what_is_recorded_touches_its_ground_and_nothing_else(
    boxes: list[Path], ground: Ground
) -> None:
    config = SimulateConfig(
        profile="bare-matcher",
        scene=tuple(boxes),
        ground=ground,
        object_turn=35.0,
        frames=1,
        width=32,
    )
    session = prepare_session(config, load_inputs(config))
    scene, floor = session.scene, session.environment.floor
    assert floor is not None
    top = floor if ground == "floor" else floor + TABLE_HEIGHT
    if ground == "table":  # its top is at that height, and under all of them
        wood = scene.vertices[np.unique(scene.faces[scene.face_objects == FURNITURE])]
        level = wood[np.abs(wood[:, 2] - top) < MM / 10, :2]
        for edge, inside in ((level.min(axis=0), -1), (level.max(axis=0), 1)):
            assert (inside * (edge - scene.object_vertices[:, :2]) > 0).all()
    plans = []
    for number in range(1, len(boxes) + 1):
        points = scene.vertices[np.unique(scene.faces[scene.face_objects == number])]
        assert abs(points[:, 2].min() - top) < MM  # neither gap nor penetration
        plans.append(plan_of(points))
    assert min(separation(*pair) for pair in combinations(plans, 2)) > 0


def test_a_given_size_scales_all_objects_by_one_factor(boxes: list[Path]) -> None:
    scene = load_objects(boxes, 0, size=0.8)
    scales = [np.cbrt(np.linalg.det(each.world_from_mesh[:3, :3])) for each in scene.objects]
    np.testing.assert_allclose(scales, 2.0)
    assert load_objects(boxes, 0, up="z").objects[0].size[2] == pytest.approx(0.08)


def test_contradictions_are_named(tmp_path: Path) -> None:
    house = save(tmp_path / "house.glb", trimesh.creation.box((9.0, 9.0, 9.0)))
    with pytest.raises(DigsError, match="--mesh and --scene contradict each other"):
        SimulateConfig(mesh=house, scene=(house,))
    with pytest.raises(DigsError, match="256 files, expected at most 255"):
        load_objects([house] * 256, 0)
