"""A mesh that lies where it could stand is named; thin and round things give no false alarm."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.sim.scene.load import UP_AXIS_BY_SUFFIX, load_scene
from digs_warp.sim.scene.mesh.resting import (
    AXES,
    MOST_VERTICES,
    better_up_axis,
    hull_of,
    reaching_out,
    tipping_angle,
)
from reference.mesh_files import save

Z_FROM_Y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def bottle(sections: int = 64, turn: float = 0.0) -> trimesh.Trimesh:
    """A bottle that stands along z, turned about it [rad]."""
    profile = [(0.0, 0.0), (0.033, 0.0), (0.033, 0.15), (0.012, 0.18), (0.012, 0.23), (0.0, 0.23)]
    mesh = trimesh.creation.revolve(np.array(profile), sections=sections)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(turn, [0, 0, 1]))
    return mesh


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".ply", ".stl"])
def test_a_bottle_with_the_wrong_axis_up_is_named_with_the_flag(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, suffix: str
) -> None:
    usual = UP_AXIS_BY_SUFFIX[suffix]
    other = "z" if usual == "y" else "y"
    mesh = bottle()
    if other == "y":
        mesh.vertices = mesh.vertices @ Z_FROM_Y  # stands along y
    path = save(tmp_path / f"bottle{suffix}", mesh)
    scene = load_scene(path, unit="m")
    (record,) = caplog.records
    assert (
        f"turn it with --mesh-up {other}, or keep it as it is with --mesh-up {usual}"
        in record.getMessage()
    )
    assert scene.size[2] < 0.1
    caplog.clear()
    assert load_scene(path, unit="m", up=other).size[2] == pytest.approx(0.23)
    load_scene(path, unit="m", up=usual)
    assert not caplog.records


@pytest.mark.parametrize("sections", [12, 64, 200])
def test_a_bottle_that_stands_is_right(sections: int) -> None:
    assert better_up_axis(bottle(sections).vertices, "z") is None
    assert better_up_axis(bottle(sections).vertices @ Z_FROM_Y, "y") is None


@pytest.mark.parametrize("turn", [0.0, np.pi / 128, np.pi / 64])
def test_a_lying_bottle_is_found_however_its_facets_are_turned(turn: float) -> None:
    assert better_up_axis(bottle(64, turn).vertices, "y") == "z"


@pytest.mark.parametrize(
    "sides",
    [(0.2, 0.25, 0.03), (0.6, 0.9, 0.02), (0.2, 0.3, 0.001), (1.0, 1.0, 1.0), (0.02, 0.02, 0.9)],
    ids=["book", "picture", "card", "cube", "rod"],
)
def test_thin_things_may_stand_or_lie(sides: tuple[float, float, float]) -> None:
    vertices = trimesh.creation.box(sides).vertices
    for axis in ("y", "z"):
        assert better_up_axis(vertices, axis) is None


def test_things_without_a_base_or_a_volume_are_left_alone() -> None:
    ball, flat = trimesh.creation.icosphere().vertices, np.random.default_rng(0).random((9, 3))
    flat[:, 1] = 0.0
    for vertices in (ball, flat, flat[:3], np.zeros((5, 3))):
        assert better_up_axis(vertices, "y") is None


def test_the_tipping_angle_is_that_of_the_geometry() -> None:
    hull = hull_of(trimesh.creation.box((0.4, 1.0, 0.2)).vertices)
    assert hull is not None
    assert tipping_angle(hull, AXES["y"], 2.0) == pytest.approx(np.rad2deg(np.arctan(0.1 / 0.5)))
    assert tipping_angle(hull, AXES["z"], 2.0) == pytest.approx(np.rad2deg(np.arctan(0.2 / 0.1)))
    np.testing.assert_allclose(hull.center, 0, atol=1e-12)


def test_what_lies_and_is_turned_is_told_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A long bottle whose sides are slanted also rolls onto them: one warning says both."""
    profile = [(0.0, 0.0), (0.04, 0.0), (0.05, 0.4), (0.0, 0.4)]
    bottle = trimesh.creation.revolve(np.array(profile), sections=64)
    scene = load_scene(save(tmp_path / "bottle.glb", bottle))
    (record,) = caplog.records
    placement = scene.objects[0].placement
    assert placement is not None and 0 < placement.turned < 5
    assert (
        f"turned by {placement.turned:.1f} degrees, so that it rests. It would stand with z up"
        in (record.getMessage())
    )


def test_what_was_turned_until_it_stands_is_not_told_to_lie(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    profile = [(0.0, 0.0), (0.07, 0.0), (0.05, 0.12), (0.0, 0.12)]
    pot = trimesh.creation.revolve(np.array(profile), sections=64)
    scene = load_scene(save(tmp_path / "pot.glb", pot))
    (record,) = caplog.records
    assert scene.size[2] == pytest.approx(0.12)
    assert "does not rest with y up; turned by 90.0 degrees" in record.getMessage()


def test_a_mesh_of_many_vertices_is_judged_like_the_same_shape_of_few() -> None:
    coarse = bottle(64)
    fine = coarse.subdivide().subdivide().subdivide().subdivide().subdivide()
    fine = fine.subdivide()
    vertices = np.asarray(fine.vertices)
    assert len(vertices) > MOST_VERTICES
    assert better_up_axis(vertices, "y") == "z"
    assert better_up_axis(vertices, "z") is None
    hull, exact = hull_of(vertices), hull_of(coarse.vertices)
    assert hull is not None and exact is not None
    assert hull.volume == pytest.approx(exact.volume, rel=2e-3)
    for level in (2.0, 12.0):
        angle = tipping_angle(exact, AXES["z"], level)
        assert tipping_angle(hull, AXES["z"], level) == pytest.approx(angle, rel=0.02)


def test_the_corners_of_a_long_thing_reach_out() -> None:
    inside = np.random.default_rng(0).uniform(-1, 1, (20_000, 3)) * (0.01, 0.2, 1.0)
    corners = np.array(trimesh.creation.box((0.02, 0.4, 2.0)).vertices)
    kept = reaching_out(np.concatenate([inside, corners]), 8)
    assert len(kept) <= 6 * 8**2
    assert all((kept == corner).all(axis=1).any() for corner in corners)
