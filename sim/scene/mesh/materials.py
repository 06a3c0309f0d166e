"""The materials that parts share, and the pixels of their maps."""

import logging
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from digs_warp.bounds import TEXTURE
from digs_warp.sim.scene.mesh.files_beside import decoding
from digs_warp.sim.scene.mesh.parts import MeshPart
from digs_warp.sim.scene.scene import Material
from digs_warp.words import quoted

logger = logging.getLogger(__name__)

# Barycentric sample points for the mean of a texture over a triangle: a rule that is exact for quadratic
# functions.
SAMPLE_POINTS = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6.0


def rgb_pixels(image: Any, name: str) -> np.ndarray:
    """Decode to (height, width, 3), uint8; alpha is dropped, not blended.

    Args:
        image: of PIL.
        name: of the material, for the message.

    Raises:
        DigsError: larger than `digs_warp.bounds.TEXTURE`, truncated or in an unknown encoding.
    """
    with _bounded(image, name):
        if image.mode.startswith("I"):  # 16-bit gray: PIL's own conversion clips at 255
            gray = (np.asarray(image).astype(np.float64) / 257.0).clip(0, 255)
            return np.repeat(np.rint(gray).astype(np.uint8)[..., None], 3, axis=2)
        return np.ascontiguousarray(np.asarray(image.convert("RGB"), np.uint8))


def alpha_pixels(image: Any, name: str) -> np.ndarray | None:
    """Decode the alpha channel to (height, width), uint8; None where every pixel is opaque."""
    with _bounded(image, name):
        if "A" not in image.getbands() and "transparency" not in image.info:
            return None
        alpha = np.ascontiguousarray(np.asarray(image.convert("RGBA"), np.uint8)[..., 3])
    return alpha if alpha.min() < 255 else None


def _bounded(image: Any, name: str) -> AbstractContextManager[None]:
    what = f"the texture of material {quoted(name)}"
    TEXTURE.check(what, image.width * image.height)
    return decoding(what)


def mean_over_surface(image: np.ndarray, parts: Sequence[MeshPart]) -> np.ndarray:
    """Return the mean texel, shape (c,), over the surface of the parts, without unused parts of the texture.

    Args:
        image: shape (height, width, c).
        parts: with texture coordinates.
    """
    height, width, channels = image.shape
    total, weight = np.zeros(channels), 0.0
    for part in parts:
        assert part.uvs is not None  # parts are grouped by it
        uvs = np.einsum("sk,mkc->msc", SAMPLE_POINTS, part.uvs[part.faces])
        columns = np.floor(uvs[..., 0] * width).astype(np.int64) % width
        rows = np.floor((1.0 - uvs[..., 1]) * height).astype(np.int64) % height
        a, b, c = np.moveaxis(part.vertices[part.faces], 1, 0)
        areas = np.nan_to_num(np.linalg.norm(np.cross(b - a, c - a), axis=1))
        total += areas @ image[rows, columns].mean(axis=1)
        weight += areas.sum()
    return total / weight if weight > 0 else image.mean(axis=(0, 1))


def color_texture(image: Any, name: str, parts: Sequence[MeshPart]) -> np.ndarray | None:
    """Return the sRGB pixels, (height, width, 3), uint8; None without image or texture coordinates."""
    if image is None:
        return None
    if parts[0].uvs is None:
        logger.warning("material %s: no texture coordinates, drawn without it", quoted(name))
        return None
    return rgb_pixels(image, name)


# Color of a mesh without any color: light gray clay, linear.
PLAIN_COLOR = (0.4, 0.4, 0.4)
PLAIN_ROUGHNESS = 0.8

# Blended texels with less opacity are holes: they have no reflections either.
MIN_OPACITY = 0.02

Convert = Callable[[Any, Sequence[MeshPart]], Material]
"""Returns the material of a file that some parts share."""


def materials_of_parts(
    parts: Sequence[MeshPart], convert: Convert
) -> tuple[tuple[Material, ...], list[int]]:
    """Return the materials, each once, and the index of the material of every part."""
    groups: dict[object, list[MeshPart]] = {}
    for part in parts:
        groups.setdefault(_key(part), []).append(part)
    numbers = {key: number for number, key in enumerate(groups)}
    materials = tuple(
        _plain(group) if group[0].material is None else convert(group[0].material, group)
        for group in groups.values()
    )
    return materials, [numbers[_key(part)] for part in parts]


def _key(part: MeshPart) -> tuple[int, bool, bool]:
    """Return what distinguishes materials; parts without coordinates cannot use a texture."""
    return id(part.material), part.uvs is not None, part.colored


def _plain(parts: Sequence[MeshPart]) -> Material:
    color = (1.0, 1.0, 1.0) if parts[0].colored else PLAIN_COLOR
    return Material("plain", np.array(color, np.float32), roughness=PLAIN_ROUGHNESS)
