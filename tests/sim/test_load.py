"""Loading meshes: other people's files, every hard case, and what normalization must not change."""

import json
import logging
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image
from reference.scene_checks import check_arrays
from trimesh.visual import ColorVisuals, TextureVisuals
from trimesh.visual.material import PBRMaterial

from digs_warp.checks import DigsError, MeshError
from digs_warp.images import linear_from_srgb
from sim.load import load_scene
from sim.mesh.normalize import STANDARD_SIZE
from sim.scene import Scene

# Size of the base-colour texture after SOURCES.md of the sample data; None: it says there is none.
SAMPLE_TEXTURES: dict[str, int | None] = {
    "armchair": 2048,
    "avocado": 2048,
    "boot_plain": None,
    "flight_helmet": 512,
    "painted_stool": 1024,
    "sci_fi_case": 1024,
    "spot": 1024,
    "sword_plain": None,
    "tea_set": 1024,
    "water_bottle_clear": 1024,
    "wooden_bookshelf": 1024,
    "ycb_cracker_box": 2048,
    "ycb_mustard_bottle": 2048,
}
# Extents in the files, y up except where the long axis says otherwise (SOURCES.md).
SAMPLE_EXTENTS = {
    "armchair": (111.772, 85.55, 96.341),
    "flight_helmet": (0.367, 0.716, 0.372),
    "wooden_bookshelf": (1.374, 2.063, 0.581),
    "ycb_mustard_bottle": (0.097, 0.191, 0.067),
}


def check_scene(scene: Scene, size: float = STANDARD_SIZE) -> None:
    """Everything that `sim.scene.Scene` promises."""
    n, m = len(scene.vertices), len(scene.faces)
    check_arrays(scene)
    assert m >= 1
    assert set(np.unique(scene.faces)) == set(range(n))
    assert scene.face_materials.min() >= 0
    assert scene.face_materials.max() < len(scene.materials)
    low, high = scene.vertices.min(axis=0), scene.vertices.max(axis=0)
    np.testing.assert_allclose((high - low).max(), size, rtol=1e-6)
    np.testing.assert_allclose(low + high, 0, atol=1e-6 * size)
    np.testing.assert_allclose(np.linalg.norm(scene.normals, axis=1), 1, atol=1e-5)
    facing = face_vectors(scene)
    assert np.linalg.norm(facing, axis=1).min() > 0
    assert (np.einsum("ij,ij->i", facing, scene.normals[scene.faces].sum(axis=1)) >= 0).all()
    assert scene.vertex_colors.min() >= 0
    assert scene.vertex_colors.max() <= 1
    for material in scene.materials:
        assert 0 <= material.roughness <= 1
        assert 0 <= material.metallic <= 1
        assert material.base_color.shape == (3,)
        if material.texture is not None:
            assert material.texture.dtype == np.uint8
            assert material.texture.ndim == 3
            assert material.texture.shape[2] == 3


def face_vectors(scene: Scene) -> np.ndarray:
    """Normals as long as twice the area of each face."""
    a, b, c = np.moveaxis(scene.vertices[scene.faces].astype(np.float64), 1, 0)
    return np.cross(b - a, c - a)


def corners_of(scene: Scene) -> np.ndarray:
    """Corner positions face by face: the shape, however vertices are shared, (m, 3, 3)."""
    return scene.vertices[scene.faces]


def save(path: Path, mesh: Any) -> Path:
    """Write a mesh or scene with trimesh, in the format of the suffix."""
    data = mesh.export(file_type=path.suffix[1:])
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


def lopsided() -> trimesh.Trimesh:
    """A small smooth mesh without any symmetry."""
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    mesh.vertices = mesh.vertices * (1.0, 1.7, 0.6)
    mesh.vertices[:, 0] += 0.3 * mesh.vertices[:, 1] ** 2
    return mesh


def checker(size: int = 16) -> Image.Image:
    """Red on the top left, green on the top right, blue below."""
    pixels = np.zeros((size, size, 3), np.uint8)
    pixels[: size // 2, : size // 2] = (255, 0, 0)
    pixels[: size // 2, size // 2 :] = (0, 255, 0)
    pixels[size // 2 :] = (0, 0, 255)
    return Image.fromarray(pixels)


def textured_square(texture_share: float = 1.0, **material: Any) -> trimesh.Trimesh:
    """A unit square in the plane z = 0 that shows the lower left part of its texture, or all."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    pbr = PBRMaterial(name="paint", **material)
    visual = TextureVisuals(uv=vertices[:, :2] * texture_share, material=pbr)
    return trimesh.Trimesh(vertices, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)


def edit_gltf(path: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """Change the JSON header of a GLB file in place."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    header = json.loads(data[20 : 20 + length])
    change(header)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    total = 20 + len(text) + len(rest)
    path.write_bytes(
        struct.pack("<4sII", b"glTF", 2, total)
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + rest
    )
    return path


# ---- other people's meshes ----


@pytest.mark.parametrize("name", SAMPLE_TEXTURES)
def test_sample_meshes_load_whole(sample_data: Path, name: str) -> None:
    scene = load_scene(sample_data / "meshes" / name / f"{name}.glb")
    check_scene(scene)
    sizes = [m.texture.shape[:2] for m in scene.materials if m.texture is not None]
    texture = SAMPLE_TEXTURES[name]
    assert set(sizes) == (set() if texture is None else {(texture, texture)})
    if texture is not None:
        textured = [i for i, m in enumerate(scene.materials) if m.texture is not None]
        corners = scene.uvs[scene.faces[np.isin(scene.face_materials, textured)]]
        assert np.ptp(corners.reshape(-1, 2), axis=0).min() > 0.3


@pytest.mark.parametrize("name", SAMPLE_EXTENTS)
def test_sample_meshes_stand_upright(sample_data: Path, name: str) -> None:
    scene = load_scene(sample_data / "meshes" / name / f"{name}.glb")
    x, y, z = SAMPLE_EXTENTS[name]
    extents = np.ptp(scene.vertices, axis=0) / scene.scale_applied
    np.testing.assert_allclose(extents, (x, z, y), rtol=0.01)


def test_the_materials_of_the_helmet_differ(sample_data: Path) -> None:
    scene = load_scene(sample_data / "meshes/flight_helmet/flight_helmet.glb")
    by_name = {material.name: material for material in scene.materials}
    assert len(by_name) == 6
    assert by_name["MetalPartsMat"].metallic > 0.5
    assert by_name["LeatherPartsMat"].metallic < 0.05
    assert by_name["LensesMat"].roughness < by_name["RubberWoodMat"].roughness
    assert [name for name, m in by_name.items() if m.is_transparent] == ["LensesMat"]
    assert by_name["LensesMat"].opacity_texture is not None
    for name, material in by_name.items():
        assert (material.normal_texture is None) == (name == "LensesMat")  # its map is flat
        assert material.finish_texture is not None


def test_clear_plastic_lets_light_through_but_not_its_label(sample_data: Path) -> None:
    scene = load_scene(sample_data / "meshes/water_bottle_clear/water_bottle_clear.glb")
    by_name = {material.name: material for material in scene.materials}
    bottle, cap = by_name["Material.001"], by_name["Material"]
    assert bottle.is_transparent and not cap.is_transparent
    assert bottle.transmission_texture is not None
    assert {0, 255} <= set(np.unique(bottle.transmission_texture))
    assert 0.5 < bottle.transmission < 0.95 and bottle.opacity == 1


def test_the_case_glows_only_where_its_texture_says(sample_data: Path) -> None:
    (case,) = load_scene(sample_data / "meshes/sci_fi_case/sci_fi_case.glb").materials
    assert case.emission == (1, 1, 1) and case.emission_texture is not None
    assert 0 < (case.emission_texture.max(axis=-1) > 50).mean() < 0.2


# ---- size, units, axes ----


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


# ---- materials and colours ----


def test_a_texture_keeps_its_orientation_and_size(tmp_path: Path) -> None:
    scene = load_scene(
        save(tmp_path / "s.glb", textured_square(baseColorTexture=checker())), up="z"
    )
    texture = scene.materials[0].texture
    assert texture is not None
    np.testing.assert_array_equal(texture, np.asarray(checker()))
    # v = 0 is the bottom row: the upper left corner of the square is red.
    corner = np.argmin(scene.vertices[:, 0] - scene.vertices[:, 1])
    np.testing.assert_allclose(scene.uvs[corner], (0, 1), atol=1e-6)


def test_pbr_factors_are_linear_and_multiplied_by_the_mean_of_their_texture(tmp_path: Path) -> None:
    image = Image.fromarray(np.full((8, 8, 3), (9, 102, 51), np.uint8))
    square = textured_square(
        baseColorFactor=[0.2, 0.4, 0.6, 1.0],
        roughnessFactor=0.5,
        metallicFactor=0.8,
        metallicRoughnessTexture=image,
    )
    material = load_scene(save(tmp_path / "s.glb", square)).materials[0]
    np.testing.assert_allclose(material.base_color, (0.2, 0.4, 0.6), atol=0.003)
    assert material.roughness == pytest.approx(0.5 * 102 / 255, abs=1e-6)
    assert material.metallic == pytest.approx(0.8 * 51 / 255, abs=1e-6)


def test_the_mean_roughness_ignores_what_the_mesh_does_not_use(tmp_path: Path) -> None:
    pixels = np.zeros((8, 8, 3), np.uint8)
    pixels[4:, :4] = (0, 204, 0)  # bottom left quarter; the rest of the atlas is empty
    square = textured_square(0.5, metallicRoughnessTexture=Image.fromarray(pixels))
    material = load_scene(save(tmp_path / "s.glb", square)).materials[0]
    assert material.roughness == pytest.approx(204 / 255, abs=1e-6)


def test_several_materials_stay_with_their_faces(tmp_path: Path) -> None:
    whole = trimesh.Scene()
    colors = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    for k, color in enumerate(colors):
        ball = trimesh.creation.icosphere(subdivisions=1, radius=0.3)
        pbr = PBRMaterial(name=f"m{k}", baseColorFactor=[*color, 1.0])
        ball.visual = TextureVisuals(material=pbr)
        ball.apply_translation((k, 0, 0))
        whole.add_geometry(ball)
    scene = load_scene(save(tmp_path / "three.glb", whole))
    check_scene(scene)
    assert sorted(m.name for m in scene.materials) == ["m0", "m1", "m2"]
    left_to_right = np.argsort(
        [corners_of(scene)[scene.face_materials == k, :, 0].mean() for k in range(3)]
    )
    assert [scene.materials[k].name for k in left_to_right] == ["m0", "m1", "m2"]
    np.testing.assert_allclose([scene.materials[k].base_color for k in left_to_right], colors)


def test_a_material_that_several_parts_share_comes_once(sample_data: Path) -> None:
    scene = load_scene(sample_data / "meshes/armchair/armchair.glb")
    names = [material.name for material in scene.materials]
    assert sorted(names) == ["M_Armchair_Cushions.001", "M_Armchair_Legs.001"]


@pytest.mark.parametrize(("suffix", "linear"), [(".glb", True), (".ply", False), (".obj", False)])
def test_vertex_colors_are_linear_in_gltf_and_srgb_elsewhere(
    tmp_path: Path, suffix: str, linear: bool
) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=1)
    colors = np.tile(np.array((51, 102, 204, 255), np.uint8), (len(mesh.vertices), 1))
    mesh.visual = ColorVisuals(mesh, vertex_colors=colors)
    scene = load_scene(save(tmp_path / f"colored{suffix}", mesh))
    stored = np.array([51, 102, 204]) / 255
    expected = stored if linear else linear_from_srgb(stored)
    np.testing.assert_allclose(
        scene.vertex_colors, np.broadcast_to(expected, scene.vertices.shape), atol=1e-5
    )
    np.testing.assert_array_equal(scene.materials[0].base_color, 1)


def test_colors_of_faces_do_not_run_into_each_other(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    colors = np.random.default_rng(3).integers(0, 256, (12, 4)).astype(np.uint8)
    colors[:, 3] = 255
    box.visual = ColorVisuals(box, face_colors=colors)
    scene = load_scene(save(tmp_path / "box.ply", box))
    check_scene(scene)
    found = scene.vertex_colors[scene.faces]
    expected = np.repeat(linear_from_srgb(colors[:, None, :3] / 255), 3, axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_mesh_without_any_color_is_plain_grey(tmp_path: Path) -> None:
    scene = load_scene(save(tmp_path / "ball.stl", trimesh.creation.icosphere(subdivisions=1)))
    (material,) = scene.materials
    assert material.texture is None
    assert np.ptp(material.base_color) == 0
    assert 0.2 < material.base_color[0] < 0.8
    np.testing.assert_array_equal(scene.vertex_colors, 1)


def test_a_texture_without_coordinates_is_left_out_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    def drop_coordinates(header: dict[str, Any]) -> None:
        del header["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]

    path = save(tmp_path / "s.glb", textured_square(baseColorTexture=checker()))
    scene = load_scene(edit_gltf(path, drop_coordinates))
    check_scene(scene)
    assert scene.materials[0].texture is None
    assert "'paint': no texture coordinates" in caplog.text


OBJ = (
    "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl paint\nf 1/1 2/2 3/3\n"
)


def test_an_obj_takes_its_texture_from_the_mtl_file(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "s.obj").write_text(OBJ)
    # A black diffuse colour beside a texture is common, and must not blacken it.
    (tmp_path / "s.mtl").write_text("newmtl paint\nKd 0 0 0\nNs 200\nmap_Kd s.png\n")
    checker().save(tmp_path / "s.png")
    (material,) = load_scene(tmp_path / "s.obj").materials
    np.testing.assert_array_equal(material.texture, np.asarray(checker()))
    np.testing.assert_array_equal(material.base_color, 1)
    assert material.roughness == pytest.approx((2 / 202) ** 0.25)
    assert not caplog.records


def test_an_obj_color_is_srgb_and_missing_files_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "s.obj").write_text(OBJ)
    (tmp_path / "s.mtl").write_text("newmtl paint\nKd 0.2 0.4 0.8\nmap_Kd gone.png\nd 0.5\n")
    (material,) = load_scene(tmp_path / "s.obj").materials
    np.testing.assert_allclose(
        material.base_color, linear_from_srgb(np.array([51, 102, 204]) / 255), atol=1e-6
    )
    assert "'gone.png' is missing" in caplog.text
    assert material.opacity == 0.5

    (tmp_path / "s.mtl").unlink()
    caplog.clear()
    check_scene(load_scene(tmp_path / "s.obj"))
    assert "'s.mtl' is missing" in caplog.text


def test_a_blended_texture_gives_opacity_and_emission_its_color(tmp_path: Path) -> None:
    pixels = np.full((4, 4, 4), 100, np.uint8)
    clear = textured_square(
        baseColorTexture=Image.fromarray(pixels), alphaMode="BLEND", emissiveFactor=[1.0, 0.5, 0.0]
    )
    (material,) = load_scene(save(tmp_path / "s.glb", clear)).materials
    np.testing.assert_array_equal(material.texture, pixels[..., :3])
    np.testing.assert_array_equal(material.opacity_texture, pixels[..., 3])
    assert material.opacity == pytest.approx(100 / 255)
    assert material.emission == (1, 0.5, 0) and material.is_transparent


def test_alpha_of_an_opaque_material_means_nothing(tmp_path: Path) -> None:
    pixels = np.full((4, 4, 4), 100, np.uint8)
    opaque = textured_square(baseColorTexture=Image.fromarray(pixels))
    (material,) = load_scene(save(tmp_path / "s.glb", opaque)).materials
    assert material.opacity == 1 and material.opacity_texture is None


def test_a_mask_cuts_holes_with_hard_edges(tmp_path: Path) -> None:
    pixels = np.full((4, 4, 4), 200, np.uint8)
    pixels[:, :2, 3] = 120
    leaf = textured_square(
        baseColorTexture=Image.fromarray(pixels), alphaMode="MASK", alphaCutoff=0.6
    )
    (material,) = load_scene(save(tmp_path / "s.glb", leaf)).materials
    assert material.opacity_texture is not None
    np.testing.assert_array_equal(material.opacity_texture[0], [0, 0, 255, 255])
    assert material.alpha_cutoff == 0.5


def test_finish_and_normal_textures_carry_their_factors(tmp_path: Path) -> None:
    finish = np.zeros((2, 2, 3), np.uint8)
    finish[0], finish[1] = (0, 100, 200), (0, 200, 0)
    tilted = np.full((2, 2, 3), (150, 128, 253), np.uint8)
    square = textured_square(
        metallicRoughnessTexture=Image.fromarray(finish),
        roughnessFactor=0.5,
        metallicFactor=1.0,
        normalTexture=Image.fromarray(tilted),
    )
    (material,) = load_scene(save(tmp_path / "s.glb", square)).materials
    np.testing.assert_array_equal(material.finish_texture, [[[50, 200]] * 2, [[100, 0]] * 2])
    np.testing.assert_array_equal(material.normal_texture, tilted)


def test_flat_normal_maps_and_even_finishes_cost_nothing(tmp_path: Path) -> None:
    flat = Image.fromarray(np.full((2, 2, 3), (128, 127, 255), np.uint8))
    even = Image.fromarray(np.full((2, 2, 3), (0, 100, 200), np.uint8))
    square = textured_square(normalTexture=flat, metallicRoughnessTexture=even)
    (material,) = load_scene(save(tmp_path / "s.glb", square)).materials
    assert material.normal_texture is None and material.finish_texture is None


def test_extensions_that_trimesh_leaves_out_are_read(tmp_path: Path) -> None:
    """Transmission with its texture, strength of emission, scale of the normal map."""
    tilted = np.full((2, 2, 3), (148, 108, 250), np.uint8)
    square = textured_square(
        emissiveFactor=[0.5, 0.5, 0.0],
        normalTexture=Image.fromarray(tilted),
        baseColorTexture=Image.fromarray(np.full((2, 2, 3), 51, np.uint8)),
    )
    path = save(tmp_path / "s.glb", square)

    def add_extensions(header: dict[str, Any]) -> None:
        material = header["materials"][0]
        material["normalTexture"]["scale"] = 0.5
        color_index = material["pbrMetallicRoughness"]["baseColorTexture"]["index"]
        material["extensions"] = {
            "KHR_materials_transmission": {
                "transmissionFactor": 0.8,
                "transmissionTexture": {"index": color_index},
            },
            "KHR_materials_emissive_strength": {"emissiveStrength": 3.0},
        }

    edit_gltf(path, add_extensions)
    (found,) = load_scene(path).materials
    assert found.emission == (1.5, 1.5, 0)
    assert found.transmission == pytest.approx(0.8 * 51 / 255, abs=2e-3)
    assert found.normal_texture is not None
    np.testing.assert_array_equal(found.normal_texture[0, 0], [138, 118, 250])


# ---- bad faces ----


@pytest.mark.filterwarnings("error")
def test_bad_faces_are_dropped_and_counted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "bad.ply"
    vertices = [
        (0, 0, 0),
        (1, 0, 0),
        (1, 1, 0),
        (0, 1, 0.5),
        (0.5, 0, 0),
        (9, "nan", 9),
        (7, 7, "inf"),
    ]
    faces = [(0, 1, 2), (0, 2, 3), (0, 0, 1), (0, 4, 1), (0, 1, 5), (6, 2, 1)]
    lines = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(map(str, v)) for v in vertices]
    lines += [" ".join(map(str, (3, *f))) for f in faces]
    path.write_text("\n".join(lines) + "\n")
    scene = load_scene(path)
    check_scene(scene)
    assert len(scene.faces) == 2
    # Vertices of dropped faces do not count for the size, either: the longest edge is 1.
    assert scene.scale_applied == pytest.approx(STANDARD_SIZE)
    assert "dropped 4 of 6 faces (2 with vertices that are not finite, 2 without area)" in (
        caplog.text
    )


def test_a_good_mesh_loads_without_a_word(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, logger="sim")
    load_scene(save(tmp_path / "a.glb", lopsided()))
    assert not caplog.records


def test_a_thin_sheet_is_not_taken_for_a_face_without_area(tmp_path: Path) -> None:
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1e-5, 0]], [[0, 1, 2]], process=False)
    assert len(load_scene(save(tmp_path / "sheet.stl", sheet)).faces) == 1


# ---- errors ----


def expect_error(path: Path, *fragments: str, **settings: Any) -> None:
    with pytest.raises(MeshError) as caught:
        load_scene(path, **settings)
    for fragment in (*fragments, str(path)):
        assert fragment in str(caught.value)


def test_a_missing_or_empty_file_or_a_folder_is_named(tmp_path: Path) -> None:
    expect_error(tmp_path / "no.glb", "no such file")
    (tmp_path / "empty.glb").touch()
    expect_error(tmp_path / "empty.glb", "0 bytes")
    (tmp_path / "folder.glb").mkdir()
    expect_error(tmp_path / "folder.glb", "found a folder")


def test_an_unknown_suffix_lists_the_known_ones(tmp_path: Path) -> None:
    path = tmp_path / "a.blend"
    path.write_bytes(b"BLENDER")
    expect_error(path, "'.blend'", ".glb, .gltf, .obj, .ply, .stl")


@pytest.mark.parametrize("share", [0.001, 0.05, 0.5, 0.9, 0.999])
@pytest.mark.parametrize("suffix", [".glb", ".stl", ".ply"])
def test_truncated_files_are_refused(tmp_path: Path, suffix: str, share: float) -> None:
    path = save(tmp_path / f"cut{suffix}", lopsided())
    data = path.read_bytes()
    path.write_bytes(data[: max(1, int(share * len(data)))])
    expect_error(path)


@pytest.mark.parametrize("suffix", [".glb", ".gltf", ".obj", ".ply", ".stl"])
def test_rubbish_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"rubbish{suffix}"
    path.write_bytes(np.random.default_rng(5).bytes(4000))
    expect_error(path)


def test_an_obj_cut_off_in_its_faces_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cut.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 9\n")
    expect_error(path)


def test_points_without_faces_are_refused(tmp_path: Path) -> None:
    points = trimesh.PointCloud(np.random.default_rng(0).random((50, 3)))
    expect_error(save(tmp_path / "cloud.ply", points), "0 faces", "point cloud")
    (tmp_path / "points.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    expect_error(tmp_path / "points.obj", "0 faces")
    assert not list(tmp_path.glob("*.glb"))


def test_only_faces_without_area_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "line.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nf 1 2 3\nf 2 3 4\nf 1 1 1\n")
    expect_error(path, "none of its 3 faces")


def gltf_folder(tmp_path: Path) -> Path:
    """A .gltf with its buffer and its texture in files of their own."""
    exported: Any = textured_square(baseColorTexture=checker()).export(file_type="gltf")
    for name, data in exported.items():
        (tmp_path / name).write_bytes(data)
    path = next(tmp_path.glob("*.gltf"))
    header = json.loads(path.read_text())
    image = header["images"][0]
    checker().save(tmp_path / "paint on wood.png")
    image.clear()
    image["uri"] = "paint%20on%20wood.png"
    path.write_text(json.dumps(header))
    return path


def test_a_gltf_reads_the_files_beside_it(tmp_path: Path) -> None:
    scene = load_scene(gltf_folder(tmp_path))
    check_scene(scene)
    np.testing.assert_array_equal(scene.materials[0].texture, np.asarray(checker()))


def test_textures_may_lie_in_a_neighbouring_folder(tmp_path: Path) -> None:
    for folder in ("mesh", "textures"):
        (tmp_path / folder).mkdir()
    (tmp_path / "mesh/s.obj").write_text(OBJ)
    (tmp_path / "mesh/s.mtl").write_text("newmtl paint\nmap_Kd ../textures/s.png\n")
    checker().save(tmp_path / "textures/s.png")
    (material,) = load_scene(tmp_path / "mesh/s.obj").materials
    np.testing.assert_array_equal(material.texture, np.asarray(checker()))


@pytest.mark.parametrize("kind", ["buffer", "image"])
def test_a_missing_file_of_a_gltf_is_named(tmp_path: Path, kind: str) -> None:
    path = gltf_folder(tmp_path)
    if kind == "buffer":
        missing = next(tmp_path.glob("*.bin"))
    else:
        missing = tmp_path / "paint on wood.png"
    missing.unlink()
    expect_error(path, f"its {kind} '{missing.name}' is missing", "copy the whole folder")


def test_a_damaged_texture_is_an_error(tmp_path: Path) -> None:
    path = gltf_folder(tmp_path)
    image = tmp_path / "paint on wood.png"
    image.write_bytes(image.read_bytes()[:60])
    expect_error(path, "paint")


def test_compressed_geometry_is_refused_with_a_way_out(tmp_path: Path) -> None:
    def compress(header: dict[str, Any]) -> None:
        header["extensionsUsed"] = ["KHR_draco_mesh_compression"]

    path = edit_gltf(save(tmp_path / "a.glb", lopsided()), compress)
    expect_error(path, "KHR_draco_mesh_compression", "without Draco compression")


def test_a_wrong_size_or_axis_is_an_error(tmp_path: Path) -> None:
    path = save(tmp_path / "a.stl", lopsided())
    for size in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(DigsError, match="size of the object"):
            load_scene(path, size=size)
    with pytest.raises(MeshError, match="'auto', 'x', 'y' or 'z'"):
        load_scene(path, up="w")


def test_suffixes_in_capitals_are_fine(tmp_path: Path) -> None:
    path = save(tmp_path / "a.glb", lopsided())
    shutil.copy(path, tmp_path / "B.GLB")
    np.testing.assert_array_equal(
        corners_of(load_scene(tmp_path / "B.GLB")), corners_of(load_scene(path))
    )
