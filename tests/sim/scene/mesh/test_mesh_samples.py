"""Other people's meshes load whole, upright and with their materials."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.sim.scene.load import load_scene, load_scene_at
from reference.mesh_files import assert_rests, check_scene

# Size of the base-color texture after SOURCES.md of the sample data; None: it says there is none.
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


@pytest.mark.parametrize("name", SAMPLE_TEXTURES)
def test_sample_meshes_load_whole_and_rest(sample_data: Path, name: str) -> None:
    path = sample_data / "meshes" / name / f"{name}.glb"
    scene = load_scene(path, size=0.4)
    check_scene(scene)
    assert_rests(scene)
    again = load_scene_at(path, scene.objects[0].world_from_mesh)
    np.testing.assert_array_equal(again.vertices, scene.vertices)
    sizes = [m.texture.shape[:2] for m in scene.materials if m.texture is not None]
    texture = SAMPLE_TEXTURES[name]
    assert set(sizes) == (set() if texture is None else {(texture, texture)})
    if texture is not None:
        textured = [i for i, m in enumerate(scene.materials) if m.texture is not None]
        corners = scene.uvs[scene.faces[np.isin(scene.face_materials, textured)]]
        assert np.ptp(corners.reshape(-1, 2), axis=0).min() > 0.3


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
