"""Size, units, axes, normals and rest on the ground: what normalization must not change."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from digs_warp.sim.scene.load import load_scene, load_scene_at
from digs_warp.sim.scene.mesh import normals
from digs_warp.sim.scene.mesh.resting import (
    MOST_FACES,
    MOST_VERTICES,
    hull_of,
    resting_turn,
    stable_ups,
)
from reference.mesh_files import check_scene, corners_of, face_vectors, lopsided, save


@pytest.mark.parametrize("longest", [0.06, 0.2, 2.0])
def test_gltf_is_in_metres_whatever_the_size(tmp_path: Path, longest: float) -> None:
    mesh = lopsided()
    mesh.apply_scale(longest / mesh.extents.max())
    scene = load_scene(save(tmp_path / "a.glb", mesh), up="y")
    check_scene(scene, size=longest)
    assert scene.objects[0].placement is not None
    assert scene.objects[0].placement.scale.origin == "glTF is in metres"


@pytest.mark.parametrize(
    ("extents", "unit", "size", "suffix"),
    [
        ((187, 240, 95), "auto", 0.24, ".obj"),
        ((187, 240, 95), "auto", 0.24, ".stl"),
        ((1.87, 2.4, 0.95), "auto", 2.4, ".ply"),
        ((0.05, 0.06, 0.03), "auto", 0.06, ".stl"),
        ((187, 240, 95), "m", 240.0, ".obj"),
        ((187, 240, 95), "cm", 2.4, ".ply"),
        ((1.87, 2.4, 0.95), "in", 2.4 * 0.0254, ".stl"),
    ],
)
def test_the_unit_of_a_file_without_one_is_stated_or_guessed(
    tmp_path: Path,
    extents: tuple[float, float, float],
    unit: str,
    size: float,
    suffix: str,
    caplog: pytest.LogCaptureFixture,
) -> None:
    path = save(tmp_path / f"box{suffix}", trimesh.creation.box(extents=extents))
    check_scene(load_scene(path, unit=unit), size=size)
    if unit == "auto" and max(extents) > 20:
        kind = suffix[1:].upper()
        assert "0.187 x 0.24 x 0.095 m" in caplog.text
        assert (
            f"{kind} has no unit: 187 x 240 x 95 taken as mm; --mesh-unit m|cm|mm|in" in caplog.text
        )
    else:
        assert not caplog.records


@pytest.mark.parametrize(
    ("suffix", "settings"),
    [(".glb", {}), (".glb", {"size": 0.3}), (".obj", {"unit": "cm"}), (".ply", {"up": "x"})],
)
def test_the_placement_takes_the_file_to_the_scene(
    tmp_path: Path, suffix: str, settings: dict[str, Any]
) -> None:
    mesh = lopsided()
    mesh.apply_translation((3.0, -2.0, 0.5))
    path = save(tmp_path / f"a{suffix}", mesh)
    scene = load_scene(path, **settings)
    assert scene.objects[0].placement is not None
    placed = trimesh.transform_points(mesh.vertices, scene.objects[0].placement.world_from_mesh)
    distances, _ = KDTree(scene.vertices).query(placed)
    assert distances.max() < 1e-6 * scene.size.max()
    again = load_scene_at(path, scene.objects[0].placement.world_from_mesh)
    np.testing.assert_array_equal(again.vertices, scene.vertices)
    np.testing.assert_array_equal(again.normals, scene.normals)


def test_a_far_away_mesh_keeps_its_shape(tmp_path: Path) -> None:
    mesh = lopsided()
    reference = load_scene(save(tmp_path / "near.obj", mesh))
    mesh.apply_translation((5e5, -3e5, 4e5))  # survey coordinates
    scene = load_scene(save(tmp_path / "far.obj", mesh))
    np.testing.assert_allclose(corners_of(scene), corners_of(reference), atol=1e-7)


@pytest.mark.parametrize(
    ("suffix", "up", "axis"),
    [
        (".glb", "auto", 1),
        (".obj", "auto", 1),
        (".ply", "auto", 2),
        (".glb", "z", 2),
        (".stl", "y", 1),
        (".ply", "x", 0),
    ],
)
def test_the_chosen_axis_points_up(tmp_path: Path, suffix: str, up: str, axis: int) -> None:
    # A cone: one vertex at the tip, many round the foot.
    cone = trimesh.creation.cone(radius=0.2, height=1.0)
    turn = trimesh.geometry.align_vectors((0, 0, 1), np.eye(3)[axis])
    cone.apply_transform(turn)
    scene = load_scene(save(tmp_path / f"cone{suffix}", cone), up=up)
    check_scene(scene)
    assert np.ptp(scene.vertices[:, 2]) == pytest.approx(1.0)
    top = scene.vertices[scene.vertices[:, 2] > 0.48]
    np.testing.assert_allclose(top[:, :2], 0, atol=1e-6)
    # Turned, not mirrored: the volume stays positive with outward windings.
    a, b, c = np.moveaxis(corners_of(scene).astype(np.float64), 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0


def test_normals_of_a_sphere_point_outward_in_every_format(tmp_path: Path) -> None:
    sphere = trimesh.creation.icosphere(subdivisions=3)
    for suffix in (".glb", ".obj", ".ply", ".stl"):
        scene = load_scene(save(tmp_path / f"sphere{suffix}", sphere))
        outward = scene.vertices / np.linalg.norm(scene.vertices, axis=1, keepdims=True)
        assert np.einsum("ij,ij->i", scene.normals, outward).min() > 0.999


# ---- normals ----


def test_a_box_without_normals_gets_flat_sides_and_shared_corners(tmp_path: Path) -> None:
    scene = load_scene(save(tmp_path / "box.stl", trimesh.creation.box(extents=(1, 2, 3))))
    facing = face_vectors(scene)
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    expected = np.repeat(facing[:, None], 3, axis=1)
    np.testing.assert_allclose(scene.normals[scene.faces], expected, atol=1e-6)
    assert len(scene.vertices) == 24  # four corners on each of six sides


def test_where_thousands_of_faces_meet_only_the_next_ones_count(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(normals, "MOST_AT_A_PLACE", 4)
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    faces = np.tile(np.asarray(box.faces), (30, 1))
    found = normals.corner_normals(np.asarray(box.vertices), faces)
    flat = np.repeat(np.asarray(box.face_normals), 3, axis=0)
    np.testing.assert_allclose(found, np.tile(flat, (30, 1)), atol=1e-12)


@pytest.mark.parametrize(("sides", "corners"), [(8, 4), (10, 2)])
def test_sides_at_45_degrees_keep_their_corners_and_those_at_36_share_them(
    tmp_path: Path, sides: int, corners: int
) -> None:
    prism = trimesh.creation.cylinder(0.05, 0.3, sections=sides)
    scene = load_scene(save(tmp_path / "prism.stl", prism))
    assert len(scene.vertices) == corners * sides + 2 * (sides + 1)


def test_normals_of_the_file_are_kept_and_turned_upright(tmp_path: Path) -> None:
    tilted = np.array([[0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [-0.6, 0.0, 0.8], [0.0, -0.6, 0.8]])
    square = trimesh.Trimesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        [[0, 1, 2], [0, 2, 3]],
        vertex_normals=tilted,
        process=False,
    )
    scene = load_scene(save(tmp_path / "square.glb", square))
    x, y, z = tilted.T
    found = {tuple(np.round(n, 5)) for n in scene.normals.astype(float)}
    assert found == {tuple(np.round(n, 5) + 0.0) for n in np.stack([x, -z, y], axis=1)}


def test_zero_and_nan_normals_of_the_file_are_replaced(tmp_path: Path) -> None:
    text = (
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvn 0 0 0\nvn nan 0 1\n"
        "f 1//1 2//2 3//3\nf 1//1 3//3 4//1\n"
    )
    path = tmp_path / "square.obj"
    path.write_text(text)
    scene = load_scene(path, up="z")
    check_scene(scene)
    np.testing.assert_allclose(scene.normals, np.tile((0, 0, 1), (len(scene.normals), 1)))


def test_nodes_are_placed_by_their_transforms_also_mirrored(tmp_path: Path) -> None:
    part = trimesh.creation.icosphere(subdivisions=2, radius=0.2)
    whole = trimesh.Scene()
    whole.add_geometry(part, node_name="one")
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    mirror[:3, 3] = (3.0, 0.0, 0.0)
    whole.add_geometry(part, node_name="two", transform=mirror)
    scene = load_scene(save(tmp_path / "two.glb", whole), up="y")
    check_scene(scene)
    np.testing.assert_allclose(np.ptp(scene.vertices, axis=0), np.array([3.4, 0.4, 0.4]), rtol=1e-5)
    half = np.where(scene.vertices[:, :1] > 0, 1, -1) * (1.5, 0, 0)
    outward = scene.vertices - half
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", scene.normals, outward).min() > 0.999


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


def test_a_center_outside_of_a_sliver_has_no_pose_of_rest() -> None:
    hull = hull_of(np.array(trimesh.creation.box().vertices))
    assert hull is not None
    ups, chances = stable_ups(replace(hull, center=np.array([0.0, 0.0, 2.0])))
    assert ups.shape == (0, 3) and chances.shape == (0,)


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


def test_the_corners_of_a_long_thing_of_many_vertices_count() -> None:
    inside = np.random.default_rng(0).uniform(-1, 1, (MOST_VERTICES, 3)) * (0.01, 0.2, 1.0)
    corners = np.array(trimesh.creation.box((0.02, 0.4, 2.0)).vertices)
    hull = hull_of(np.concatenate([inside, corners]))
    assert hull is not None
    found = np.unique(hull.corners.reshape(-1, 3), axis=0)
    np.testing.assert_array_equal(found, np.unique(corners, axis=0))
    np.testing.assert_allclose(hull.center, 0, atol=1e-9)


def test_a_needle_in_which_no_pose_is_found_stays_as_it_is() -> None:
    vertices = np.array(trimesh.creation.box((0.001, 0.001, 0.001)).vertices)
    vertices[3, 2] = 1e6
    np.testing.assert_array_equal(resting_turn(vertices), np.eye(3))
