"""Size, units, axes, normals and placement: what normalization must not change."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.sim.load import load_scene
from digs_warp.sim.mesh.normalize import STANDARD_SIZE
from reference.mesh_files import check_scene, corners_of, face_vectors, lopsided, save


@pytest.mark.parametrize("factor", [1000.0, 0.001, 1.0])
@pytest.mark.parametrize("suffix", [".glb", ".obj", ".stl"])
def test_the_units_of_the_file_change_nothing_but_the_scale(
    tmp_path: Path, factor: float, suffix: str
) -> None:
    mesh = lopsided()
    reference = load_scene(save(tmp_path / f"unit{suffix}", mesh))
    mesh.apply_scale(factor)
    scene = load_scene(save(tmp_path / f"scaled{suffix}", mesh))
    check_scene(scene)
    # OBJ files hold eight decimals.
    tolerance = 1e-5 if suffix == ".obj" and factor < 1 else 1e-6
    np.testing.assert_allclose(corners_of(scene), corners_of(reference), atol=tolerance)
    assert scene.scale_applied * factor == pytest.approx(reference.scale_applied, rel=1e-5)


def test_a_far_away_mesh_keeps_its_shape(tmp_path: Path) -> None:
    mesh = lopsided()
    reference = load_scene(save(tmp_path / "near.obj", mesh))
    mesh.apply_translation((5e5, -3e5, 4e5))  # survey coordinates
    scene = load_scene(save(tmp_path / "far.obj", mesh))
    np.testing.assert_allclose(corners_of(scene), corners_of(reference), atol=1e-7)


def test_scale_applied_is_metres_per_unit(tmp_path: Path) -> None:
    path = save(tmp_path / "box.stl", trimesh.creation.box(extents=(10, 20, 40)))
    assert load_scene(path).scale_applied == pytest.approx(STANDARD_SIZE / 40)
    scene = load_scene(path, size=2.0)
    assert scene.scale_applied == pytest.approx(2.0 / 40)
    check_scene(scene, size=2.0)


def test_the_same_mesh_as_y_up_glb_and_z_up_ply_is_the_same_scene(tmp_path: Path) -> None:
    mesh = lopsided()
    from_ply = load_scene(save(tmp_path / "a.ply", mesh))
    y_up = mesh.copy()
    y_up.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
    from_glb = load_scene(save(tmp_path / "a.glb", y_up))
    np.testing.assert_allclose(corners_of(from_glb), corners_of(from_ply), atol=2e-7)
    np.testing.assert_allclose(
        from_glb.normals[from_glb.faces], from_ply.normals[from_ply.faces], atol=1e-5
    )


@pytest.mark.parametrize(
    ("suffix", "up", "axis"),
    [
        (".glb", "auto", 1),
        (".obj", "auto", 1),
        (".ply", "auto", 2),
        (".stl", "auto", 2),
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
    assert np.ptp(scene.vertices[:, 2]) == pytest.approx(STANDARD_SIZE)
    top = scene.vertices[scene.vertices[:, 2] > 0.24]
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
    np.testing.assert_allclose(
        np.ptp(scene.vertices, axis=0), 0.5 * np.array([3.4, 0.4, 0.4]) / 3.4, rtol=1e-5
    )
    half = np.where(scene.vertices[:, :1] > 0, 1, -1) * (0.5 * 1.5 / 3.4, 0, 0)
    outward = scene.vertices - half
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", scene.normals, outward).min() > 0.999
