"""The base colors of a scene at its vertices, for meshes without textures. NumPy only."""

import numpy as np

from digs_warp.data.images import linear_from_srgb, srgb_from_linear
from digs_warp.sim.scene.scene import Scene


def srgb_vertex_colors(scene: Scene) -> np.ndarray:
    """Return the base color at every vertex, sRGB in 0..1, shape (n, 3), float32.

    As in glTF, the product of the material's factor, its texture (bilinear, repeated) and the vertex
    color. The texture between vertices is lost. A vertex of several materials has the color of its last
    face; one without a face is white.
    """
    materials = np.full(len(scene.vertices), -1)
    materials[scene.faces.reshape(-1)] = np.repeat(scene.face_materials, 3)
    linear = np.ones((len(scene.vertices), 3))
    for number, material in enumerate(scene.materials):
        own = materials == number
        color = np.asarray(material.base_color, dtype=np.float64) * scene.vertex_colors[own]
        if material.texture is not None:
            color = color * sampled_texture(material.texture, scene.uvs[own])
        linear[own] = color
    return srgb_from_linear(np.clip(linear, 0.0, 1.0)).astype(np.float32)


def sampled_texture(texture: np.ndarray, uvs: np.ndarray) -> np.ndarray:
    """Return the bilinear, linear RGB values, shape (n, 3), of an sRGB texture at ``uvs``, (n, 2).

    Texels are averaged in linear light; coordinates repeat, and v = 0 is the bottom row. ``texture`` has
    shape (height, width, 3), uint8.
    """
    height, width = texture.shape[:2]
    decode = linear_from_srgb(np.arange(256) / 255.0)
    turns = uvs.astype(np.float64) - np.floor(uvs.astype(np.float64))
    x = turns[:, 0] * width - 0.5
    y = (1.0 - turns[:, 1]) * height - 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    right_share, low_share = (x - left)[:, None], (y - top)[:, None]

    def texels(row: np.ndarray, column: np.ndarray) -> np.ndarray:
        return decode[texture[row % height, column % width, :3]]

    upper = (1 - right_share) * texels(top, left) + right_share * texels(top, left + 1)
    lower = (1 - right_share) * texels(top + 1, left) + right_share * texels(top + 1, left + 1)
    return (1 - low_share) * upper + low_share * lower
