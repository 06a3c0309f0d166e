import numpy as np
from numpy.testing import assert_allclose

from digs_warp.data.images import linear_from_srgb, srgb_from_linear
from digs_warp.sim.scene.join import sampled_texture, srgb_vertex_colors
from digs_warp.sim.scene.scene import Material, Scene


def slow_sample(texture: np.ndarray, u: float, v: float) -> np.ndarray:
    """Bilinear by the definition: every texel weighs by its distance, the image repeated three times."""
    height, width = texture.shape[:2]
    u, v = u % 1.0, v % 1.0
    total = np.zeros(3)
    for row in range(-height, 2 * height):
        for column in range(-width, 2 * width):
            x = abs(u * width - (column + 0.5))
            y = abs((1 - v) * height - (row + 0.5))
            if x < 1 and y < 1:
                texel = texture[row % height, column % width] / 255.0
                total += (1 - x) * (1 - y) * linear_from_srgb(texel)
    return total


def test_textures_are_sampled_between_texels_and_repeat():
    rng = np.random.default_rng(0)
    texture = rng.integers(0, 256, (4, 6, 3), dtype=np.uint8)
    uvs = np.vstack([rng.uniform(-2, 3, (50, 2)), [[0, 0], [1, 1], [0.999, 0.001], [-1, 2]]])
    expected = [slow_sample(texture, u, v) for u, v in uvs]
    assert_allclose(sampled_texture(texture, uvs), expected, atol=1e-12)


def test_factor_texture_and_vertex_color_multiply_for_each_material():
    texture = np.full((1, 1, 3), 128, dtype=np.uint8)
    materials = (
        Material("textured", np.array([1.0, 0.5, 0.25]), texture),
        Material("plain", np.array([0.1, 0.2, 0.3])),
    )
    vertex_colors = np.ones((7, 3), np.float32)
    vertex_colors[0] = 0.5
    scene = Scene(
        vertices=np.zeros((7, 3), np.float32),
        faces=np.array([[0, 1, 2], [3, 4, 5]], np.int32),
        face_materials=np.array([0, 1], np.int32),
        normals=np.zeros((7, 3), np.float32),
        uvs=np.zeros((7, 2), np.float32),
        vertex_colors=vertex_colors,
        materials=materials,
    )
    gray = linear_from_srgb(np.array(128 / 255))
    linear = np.array([[1.0, 0.5, 0.25]]) * gray
    expected = np.vstack([0.5 * linear, linear, linear, [[0.1, 0.2, 0.3]] * 3])
    found = srgb_vertex_colors(scene)
    assert found.dtype == np.float32
    assert_allclose(found[:6], srgb_from_linear(expected), atol=1e-6)
    assert_allclose(found[6], 1.0)  # in no face
