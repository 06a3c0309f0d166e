"""Other people's meshes load whole, upright and with their materials; large scans in little memory."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.sim.scene.load import load_scene, load_scene_at
from reference.mesh_files import assert_rests, check_scene, save

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


SIDE = 400
# All steps at once took 1,070.
MOST_BYTES_PER_TRIANGLE = 600


def write_grid(path: Path) -> int:
    """Write a wavy sheet as binary PLY; return its triangles."""
    x, y = np.meshgrid(np.linspace(0, 1, SIDE + 1), np.linspace(0, 1, SIDE + 1), indexing="ij")
    vertices = np.stack([x, y, 0.1 * np.sin(9 * x) * np.cos(7 * y)], axis=-1).reshape(-1, 3)
    corner = np.arange(len(vertices)).reshape(SIDE + 1, SIDE + 1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.concatenate([np.stack([a, b, d], -1), np.stack([b, c, d], -1)]).reshape(-1, 3)
    save(path, trimesh.Trimesh(vertices, faces, process=False))
    return len(faces)


def test_a_large_scan_takes_little_memory(tmp_path: Path):
    count = write_grid(tmp_path / "scan.ply")
    tracemalloc.start()
    try:
        scene = load_scene(tmp_path / "scan.ply")
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(scene.faces) == count
    assert peak < MOST_BYTES_PER_TRIANGLE * count
    np.testing.assert_allclose(np.linalg.norm(scene.normals, axis=1), 1, atol=1e-5)
