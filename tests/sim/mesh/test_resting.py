"""A mesh that lies where it could stand is named; thin and round things give no false alarm."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.sim.load import UP_AXIS_BY_SUFFIX, load_scene
from digs_warp.sim.mesh.resting import AXES, better_up_axis, hull_of, tipping_angle
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
    assert f"turn it with --up {other}, or confirm with --up {usual}" in record.getMessage()
    assert scene.size[2] < 0.1
    caplog.clear()
    assert load_scene(path, unit="m", up=other).size[2] == pytest.approx(0.23)
    load_scene(path, unit="m", up=usual)
    assert not caplog.records


@pytest.mark.parametrize("sections", [12, 64, 200])
def test_a_bottle_that_stands_is_right(sections: int) -> None:
    assert better_up_axis(bottle(sections).vertices, "z") is None
    assert better_up_axis(bottle(sections).vertices @ Z_FROM_Y, "y") is None


@pytest.mark.parametrize("turn", np.linspace(0, 2 * np.pi / 64, 5))
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
