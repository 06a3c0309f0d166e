"""Objects rest on the ground: what stands keeps its pose, what would fall is turned."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.sim.scene.load import load_scene
from digs_warp.sim.scene.mesh.resting import (
    MOST_FACES,
    MOST_VERTICES,
    hull_of,
    reaching_out,
    resting_turn,
    stable_ups,
)
from reference.mesh_files import save


def tilted(sides: tuple[float, float, float], degrees: float) -> trimesh.Trimesh:
    """A box turned about x."""
    turn = trimesh.transformations.rotation_matrix(np.deg2rad(degrees), [1, 0, 0])
    return trimesh.creation.box(sides, transform=turn)


def angle_of(turn: np.ndarray) -> float:
    return float(np.rad2deg(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))))


@pytest.mark.parametrize("lean", [0.0, 3.0, 20.0, 40.0])
def test_a_leaning_box_is_set_onto_its_face(lean: float) -> None:
    vertices = np.array(tilted((0.2, 0.3, 0.25), lean).vertices)
    turn = resting_turn(vertices)
    assert angle_of(turn) == pytest.approx(lean, abs=1e-6)
    turned = vertices @ turn.T
    assert np.ptp(turned, axis=0) == pytest.approx((0.2, 0.3, 0.25))
    if lean == 0.0:
        np.testing.assert_array_equal(turn, np.eye(3))  # not even a rounding error


def test_a_box_on_its_edge_falls_to_a_probable_side() -> None:
    """45 degrees from two sides, one of them three times as large."""
    vertices = np.array(tilted((0.3, 0.3, 0.1), 46.0).vertices)
    turned = vertices @ resting_turn(vertices).T
    assert np.ptp(turned[:, 2]) == pytest.approx(0.1)


def test_up_keeps_the_pose_of_the_file(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = save(tmp_path / "box.ply", tilted((0.2, 0.3, 0.1), 40.0))
    assert load_scene(path, up="z").objects[0].placement.turned == 0.0  # type: ignore[union-attr]
    assert not caplog.records
    scene = load_scene(path)
    assert scene.size == pytest.approx((0.2, 0.3, 0.1), abs=1e-6)
    assert "turned by 40.0 degrees, so that it does. --mesh-up z keeps it" in caplog.text
    placement = scene.objects[0].placement
    assert placement is not None and placement.turned == pytest.approx(40.0, abs=1e-3)


def test_the_poses_of_a_round_thing_are_found_on_fewer_faces() -> None:
    """An egg of 20,000 faces; no pose is much more probable than the others of the same height."""
    egg = trimesh.creation.icosphere(5, 0.1)
    hull = hull_of(np.array(egg.vertices) * (1.0, 1.0, 1.4))
    assert hull is not None and len(hull.corners) > MOST_FACES
    ups, chances = stable_ups(hull)
    assert 8 <= len(ups) < MOST_FACES
    assert chances.sum() == pytest.approx(1.0, abs=0.1)
    assert abs(chances @ ups[:, 2]) < 0.1
    assert np.abs(ups[np.argmax(chances), 2]) < 0.2  # it lies


def test_a_mesh_of_many_vertices_is_judged_like_the_same_shape_of_few() -> None:
    coarse = trimesh.creation.revolve(
        np.array([(0, 0), (0.1, 0), (0.05, 0.3), (0, 0.3)]), sections=64
    )
    fine = coarse
    while len(fine.vertices) <= MOST_VERTICES:
        fine = fine.subdivide()
    hull, exact = hull_of(np.array(fine.vertices)), hull_of(np.array(coarse.vertices))
    assert hull is not None and exact is not None
    np.testing.assert_allclose(hull.center, exact.center, atol=1e-3)


def test_the_corners_of_a_long_thing_reach_out() -> None:
    inside = np.random.default_rng(0).uniform(-1, 1, (20_000, 3)) * (0.01, 0.2, 1.0)
    corners = np.array(trimesh.creation.box((0.02, 0.4, 2.0)).vertices)
    kept = reaching_out(np.concatenate([inside, corners]), 8)
    assert len(kept) <= 6 * 8**2
    assert all((kept == corner).all(axis=1).any() for corner in corners)
