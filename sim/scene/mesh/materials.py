"""Materials of MTL files as `digs_warp.sim.scene.scene.Material`, and the pixels of all materials' maps."""

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from digs_warp.bounds import TEXTURE
from digs_warp.data.images import linear_from_srgb
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


def _is_empty(source: Any) -> bool:
    """Whether trimesh invented a material for a mesh that has texture coordinates but no material."""
    from_no_file = source.image is None or source.image.format is None  # its own gray image
    return from_no_file and not source.kwargs and source.name == "material_0"


def mtl_material(
    opacity_maps: Mapping[str, Any], source: Any, parts: Sequence[MeshPart]
) -> Material:
    """Convert a material of an MTL file: colors are sRGB, as in most programs.

    With a texture the diffuse color is ignored: exporters write any color there, even black.

    Args:
        opacity_maps: PIL images that trimesh leaves out, by name of the material.
        source: of trimesh.
        parts: that share it.
    """
    if _is_empty(source):
        return _plain(parts)
    name = str(source.name)
    texture = color_texture(source.image, name, parts)
    opacity_map = opacity_maps.get(name, source.image)
    plain = texture is None and "kd" in source.kwargs
    base_color = linear_from_srgb(np.asarray(source.diffuse)[:3] / 255.0) if plain else np.ones(3)
    if texture is None and not plain and not parts[0].colored:
        base_color = np.array(PLAIN_COLOR)
    # Blinn-Phong exponent to GGX width, alpha^2 = 2 / (exponent + 2); roughness is the root of alpha.
    exponent = max(float(source.glossiness), 0.0)
    roughness = (2.0 / (exponent + 2.0)) ** 0.25 if "ns" in source.kwargs else PLAIN_ROUGHNESS
    return Material(
        name,
        base_color.astype(np.float32),
        texture,
        roughness,
        **_mtl_opacity(source, name, None if parts[0].uvs is None else opacity_map),
    )


def _mtl_opacity(source: Any, name: str, image: Any) -> dict[str, Any]:
    """Return opacity from an MTL's ``d`` or ``Tr`` and from ``map_d`` or the alpha of its texture."""
    try:
        transparency = 1.0 - float(source.kwargs.get("tr", ["0"])[-1])
        opacity = float(source.kwargs.get("d", [transparency])[-1])
    except ValueError:
        opacity = 1.0
    opacity = float(np.clip(opacity, 0.0, 1.0))
    alpha = None if image is None else alpha_pixels(image, name)
    if alpha is None and image is not None and image is not source.image:
        alpha = rgb_pixels(image, name)[..., 0]  # a map in gray
    if alpha is None:
        return {"opacity": opacity}
    return {
        "opacity": opacity * float(alpha.mean()) / 255.0,
        "opacity_texture": np.rint(alpha * opacity).astype(np.uint8),
        "alpha_cutoff": MIN_OPACITY,
    }
