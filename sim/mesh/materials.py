"""Materials of trimesh (glTF and MTL) as `sim.scene.Material`."""

import logging
from collections.abc import Sequence
from typing import Any

import numpy as np

from digs_warp.images import linear_from_srgb
from sim.mesh.parts import MeshPart
from sim.scene import Material

logger = logging.getLogger(__name__)

# What a mesh without any colour is drawn in: light grey clay, linear.
PLAIN_COLOR = (0.4, 0.4, 0.4)
PLAIN_ROUGHNESS = 0.8

# Where the factors of a triangle are looked up in its metallic-roughness texture (barycentric): a rule
# that is exact for quadratic functions.
SAMPLE_POINTS = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6.0


def materials_of_parts(parts: Sequence[MeshPart]) -> tuple[tuple[Material, ...], list[int]]:
    """Return the materials, each once, and the index of the material of every part."""
    groups: dict[object, list[MeshPart]] = {}
    for part in parts:
        groups.setdefault(_key(part), []).append(part)
    numbers = {key: number for number, key in enumerate(groups)}
    materials = tuple(_material(group) for group in groups.values())
    return materials, [numbers[_key(part)] for part in parts]


def _key(part: MeshPart) -> tuple[int, bool, bool]:
    """Tell materials apart; parts without coordinates cannot use the texture of the others."""
    return id(part.material), part.uvs is not None, part.colored


def _material(parts: list[MeshPart]) -> Material:
    """Convert the material that all ``parts`` share."""
    from trimesh.visual.material import PBRMaterial, SimpleMaterial

    source = parts[0].material
    if isinstance(source, PBRMaterial):
        return _pbr_material(source, parts)
    if isinstance(source, SimpleMaterial) and not _is_empty(source):
        return _simple_material(source, parts)
    color = (1.0, 1.0, 1.0) if parts[0].colored else PLAIN_COLOR
    return Material("plain", np.array(color, np.float32), roughness=PLAIN_ROUGHNESS)


def _is_empty(source: Any) -> bool:
    """Whether trimesh made up a material for a mesh that has texture coordinates but no material."""
    return source.image is None and not source.kwargs and source.name == "material_0"


def _pbr_material(source: Any, parts: list[MeshPart]) -> Material:
    """Convert glTF's metallic-roughness model; its factors are linear and 1 where they are left out."""
    name = str(source.name or "material")
    factor = source.baseColorFactor  # RGBA bytes, still linear
    base_color = np.ones(3) if factor is None else np.asarray(factor)[:3] / 255.0
    roughness = 1.0 if source.roughnessFactor is None else source.roughnessFactor
    metallic = 1.0 if source.metallicFactor is None else source.metallicFactor
    if source.metallicRoughnessTexture is not None and parts[0].uvs is not None:
        image = _rgb_pixels(source.metallicRoughnessTexture, name)
        _, green, blue = _mean_over_surface(image, parts) / 255.0
        roughness, metallic = roughness * green, metallic * blue
    return Material(
        name=name,
        base_color=base_color.astype(np.float32),
        texture=_texture(source.baseColorTexture, name, parts),
        roughness=float(np.clip(roughness, 0, 1)),
        metallic=float(np.clip(metallic, 0, 1)),
    )


def _simple_material(source: Any, parts: list[MeshPart]) -> Material:
    """Convert a material of an MTL file: colours are sRGB, as most programs take them.

    With a texture the diffuse colour does not count: exporters leave anything there, even black.
    """
    name = str(source.name)
    texture = _texture(source.image, name, parts)
    if (texture is not None and _has_alpha(source.image)) or _dissolved(source):
        logger.warning(
            "material '%s': transparency is not modelled yet, the part is drawn opaque", name
        )
    plain = texture is None and "kd" in source.kwargs
    base_color = linear_from_srgb(np.asarray(source.diffuse)[:3] / 255.0) if plain else np.ones(3)
    if texture is None and not plain and not parts[0].colored:
        base_color = np.array(PLAIN_COLOR)
    # Blinn-Phong exponent to GGX width, alpha^2 = 2 / (exponent + 2); roughness is the root of alpha.
    exponent = max(float(source.glossiness), 0.0)
    roughness = (2.0 / (exponent + 2.0)) ** 0.25 if "ns" in source.kwargs else PLAIN_ROUGHNESS
    return Material(name, base_color.astype(np.float32), texture, roughness)


def _dissolved(source: Any) -> bool:
    """Whether an MTL material has an opacity ``d`` below 1 or a transparency ``Tr`` above 0."""
    try:
        opacity = float(source.kwargs.get("d", ["1"])[-1])
        transparency = float(source.kwargs.get("tr", ["0"])[-1])
    except ValueError:
        return False
    return opacity < 1 or transparency > 0


def _has_alpha(image: Any) -> bool:
    return "A" in image.getbands() and image.getchannel("A").getextrema()[0] < 255


def _texture(image: Any, name: str, parts: list[MeshPart]) -> np.ndarray | None:
    if image is None:
        return None
    if parts[0].uvs is None:
        logger.warning("material '%s': no texture coordinates, drawn without its texture", name)
        return None
    return _rgb_pixels(image, name)


def _rgb_pixels(image: Any, name: str) -> np.ndarray:
    """Decode a PIL image to (height, width, 3) uint8; alpha is left out, not blended."""
    try:
        if image.mode.startswith("I"):  # 16-bit grey: PIL's own conversion clips at 255
            grey = (np.asarray(image).astype(np.float64) / 257.0).clip(0, 255)
            return np.repeat(np.rint(grey).astype(np.uint8)[..., None], 3, axis=2)
        return np.ascontiguousarray(np.asarray(image.convert("RGB"), np.uint8))
    except (OSError, ValueError, SyntaxError) as error:
        raise ValueError(f"the texture of material '{name}' cannot be decoded ({error})") from error


def _mean_over_surface(image: np.ndarray, parts: list[MeshPart]) -> np.ndarray:
    """Return the mean texel, shape (3,), over the surface of the parts, not over the unused atlas."""
    height, width, _ = image.shape
    total, weight = np.zeros(3), 0.0
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
