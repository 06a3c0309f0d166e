"""The built-in object: sound geometry, everything that a reconstruction finds hard, always the same."""

import numpy as np
import pytest

from digs_warp.sim.scene.builtin import builtin_scene, builtin_shape
from digs_warp.sim.scene.scene import Scene
from reference.mesh_files import assert_rests
from reference.scene_checks import check_arrays


@pytest.fixture(scope="module")
def scene() -> Scene:
    return builtin_scene()


def triangle_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(vertices[faces].astype(np.float64), 1, 0)
    return np.cross(b - a, c - a)


def test_arrays_fit_the_scene_type_and_cannot_be_changed(scene: Scene) -> None:
    for array in (scene.vertices, scene.faces, scene.materials[0].texture):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    n, m = len(scene.vertices), len(scene.faces)
    assert 20_000 <= m <= 70_000
    check_arrays(scene)
    assert scene.faces.min() == 0
    assert scene.faces.max() == n - 1
    assert set(scene.face_materials) == set(range(len(scene.materials)))
    assert_rests(scene)
    low, high = scene.vertices.min(axis=0), scene.vertices.max(axis=0)
    np.testing.assert_allclose(high[2], 0.25, atol=1e-6)
    np.testing.assert_allclose(low + high, 0, atol=1e-6)


def test_normals_are_unit_and_agree_with_every_face(scene: Scene) -> None:
    np.testing.assert_allclose(np.linalg.norm(scene.normals, axis=1), 1, atol=1e-5)
    facing = triangle_normals(scene.vertices, scene.faces)
    area = np.linalg.norm(facing, axis=1)
    assert area.min() > 0
    cosine = np.einsum("ij,ij->i", facing, scene.normals[scene.faces].mean(axis=1)) / area
    assert (cosine > 0).mean() > 0.999
    assert np.quantile(cosine, 0.05) > 0.85  # less only where rims a millimetre wide turn round


def test_the_plain_shape_is_that_of_the_textured_object(scene: Scene) -> None:
    plain = builtin_shape()
    np.testing.assert_array_equal(plain.vertices, scene.vertices)
    np.testing.assert_array_equal(plain.faces, scene.faces)
    np.testing.assert_array_equal(plain.face_materials, scene.face_materials)
    check_arrays(plain)
    assert all(material.texture is None for material in plain.materials)
