"""Materials of trimesh (glTF and MTL) as `digs_warp.sim.scene.scene.Material`."""

import logging
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from digs_warp.bounds import TEXTURE
from digs_warp.data.images import linear_from_srgb
from digs_warp.sim.scene.mesh.files_beside import decoding
from digs_warp.sim.scene.mesh.gltf_materials import GltfExtras
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

# glTF's default cut-off for alphaMode MASK.
DEFAULT_CUTOFF = 0.5

# Zero of x and y in a normal map.
FLAT = 128


def materials_of_parts(
    parts: Sequence[MeshPart], extras: Mapping[str, GltfExtras], opacity_maps: Mapping[str, Any]
) -> tuple[tuple[Material, ...], list[int]]:
    """Return the materials, each once, and the index of the material of every part.

    Args:
        parts: with the materials of trimesh.
        extras: properties that trimesh leaves out, by name of the material.
        opacity_maps: PIL images of MTL files that trimesh leaves out, likewise.
    """
    groups: dict[object, list[MeshPart]] = {}
    for part in parts:
        groups.setdefault(_key(part), []).append(part)
    numbers = {key: number for number, key in enumerate(groups)}
    materials = tuple(_material(group, extras, opacity_maps) for group in groups.values())
    return materials, [numbers[_key(part)] for part in parts]


def _key(part: MeshPart) -> tuple[int, bool, bool]:
    """Return what distinguishes materials; parts without coordinates cannot use a texture."""
    return id(part.material), part.uvs is not None, part.colored


def _material(
    parts: list[MeshPart], extras: Mapping[str, GltfExtras], opacity_maps: Mapping[str, Any]
) -> Material:
    """Convert the material that all ``parts`` share."""
    from trimesh.visual.material import PBRMaterial, SimpleMaterial

    source = parts[0].material
    if isinstance(source, PBRMaterial):
        return _pbr_material(source, parts, extras.get(str(source.name), GltfExtras()))
    if isinstance(source, SimpleMaterial) and not _is_empty(source):
        return _simple_material(source, parts, opacity_maps.get(str(source.name)))
    color = (1.0, 1.0, 1.0) if parts[0].colored else PLAIN_COLOR
    return Material("plain", np.array(color, np.float32), roughness=PLAIN_ROUGHNESS)


def _is_empty(source: Any) -> bool:
    """Whether trimesh invented a material for a mesh that has texture coordinates but no material."""
    from_no_file = source.image is None or source.image.format is None  # its own gray image
    return from_no_file and not source.kwargs and source.name == "material_0"


def _simple_material(source: Any, parts: list[MeshPart], opacity_map: Any) -> Material:
    """Convert a material of an MTL file: colors are sRGB, as in most programs.

    With a texture the diffuse color is ignored: exporters write any color there, even black.
    """
    name = str(source.name)
    texture = color_texture(source.image, name, parts)
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
        **_mtl_opacity(source, name, None if parts[0].uvs is None else opacity_map or source.image),
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


def _pbr_material(source: Any, parts: Sequence[MeshPart], extras: GltfExtras) -> Material:
    """Convert a `PBRMaterial` of trimesh; its factors are linear and default to 1."""
    name = str(source.name or "material")
    factor = source.baseColorFactor  # RGBA bytes, still linear
    base_color = np.ones(3) if factor is None else np.asarray(factor)[:3] / 255.0
    return Material(
        name=name,
        base_color=base_color.astype(np.float32),
        texture=color_texture(source.baseColorTexture, name, parts),
        **_finish(source, name, parts),
        **_opacity(source, name, parts),
        **_transmission(extras, name, parts),
        ior=extras.ior,
        reflectance=extras.reflectance,
        absorption=extras.absorption,
        clear_coat=extras.clear_coat * float(_mean(extras.clear_coat_image, name, parts)[0]),
        clear_coat_roughness=extras.clear_coat_roughness,
        sheen=_sheen(extras, name, parts),
        sheen_roughness=extras.sheen_roughness,
        **_emission(source, name, parts, extras.emissive_strength),
        normal_texture=_normals(source, name, parts, extras.normal_scale),
    )


def _finish(source: Any, name: str, parts: Sequence[MeshPart]) -> dict[str, Any]:
    """Return roughness and metallic, and their texture where they vary."""
    factors = np.array(
        [
            1.0 if source.roughnessFactor is None else source.roughnessFactor,
            1.0 if source.metallicFactor is None else source.metallicFactor,
        ]
    )
    texture = None
    if source.metallicRoughnessTexture is not None and parts[0].uvs is not None:
        pixels = rgb_pixels(source.metallicRoughnessTexture, name)[..., 1:]
        texture = _scaled(pixels, factors) if np.ptp(pixels, axis=(0, 1)).any() else None
        factors = factors * mean_over_surface(pixels, parts) / 255.0
    roughness, metallic = np.clip(factors, 0.0, 1.0)
    return {
        "roughness": float(roughness),
        "metallic": float(metallic),
        "finish_texture": texture,
    }


def _opacity(source: Any, name: str, parts: Sequence[MeshPart]) -> dict[str, Any]:
    """Return opacity, its texture where it varies, and the cut-off; nothing for opaque materials."""
    mode = source.alphaMode or "OPAQUE"
    if mode == "OPAQUE":
        return {}
    factor = 1.0 if source.baseColorFactor is None else source.baseColorFactor[3] / 255.0
    image = source.baseColorTexture
    alpha = None if image is None or parts[0].uvs is None else alpha_pixels(image, name)
    if mode == "MASK":
        cutoff = DEFAULT_CUTOFF if source.alphaCutoff is None else float(source.alphaCutoff)
        if alpha is not None:
            alpha = np.where(alpha / 255.0 * factor >= cutoff, 255, 0).astype(np.uint8)
        factor = 1.0 if factor >= cutoff or alpha is not None else 0.0
    if alpha is None:
        return {"opacity": float(factor)}
    alpha = _scaled(alpha, factor)
    return {
        "opacity": float(mean_over_surface(alpha[..., None], parts)[0] / 255.0),
        "opacity_texture": alpha,
        "alpha_cutoff": DEFAULT_CUTOFF if mode == "MASK" else MIN_OPACITY,
    }


def _transmission(extras: GltfExtras, name: str, parts: Sequence[MeshPart]) -> dict[str, Any]:
    """Return transmission, and its texture where it varies."""
    if extras.transmission <= 0:
        return {}
    if extras.transmission_image is None or parts[0].uvs is None:
        return {"transmission": extras.transmission}
    pixels = _scaled(rgb_pixels(extras.transmission_image, name)[..., 0], extras.transmission)
    return {
        "transmission": float(mean_over_surface(pixels[..., None], parts)[0] / 255.0),
        "transmission_texture": pixels,
    }


def _sheen(extras: GltfExtras, name: str, parts: Sequence[MeshPart]) -> tuple[float, float, float]:
    """Return the color of the fibers, linear: the mean where it varies."""
    if not any(extras.sheen):
        return extras.sheen
    mean = linear_from_srgb(_mean(extras.sheen_image, name, parts))
    red, green, blue = (float(value) for value in np.array(extras.sheen) * mean)
    return red, green, blue


def _mean(image: Any, name: str, parts: Sequence[MeshPart]) -> np.ndarray:
    """Return the mean of a map over the surface, (3,), 0 to 1; 1 without a map."""
    if image is None or parts[0].uvs is None:
        return np.ones(3)
    return mean_over_surface(rgb_pixels(image, name), parts) / 255.0


def _emission(source: Any, name: str, parts: Sequence[MeshPart], strength: float) -> dict[str, Any]:
    """Return the emission and its texture; nothing for materials that do not glow."""
    factor = np.zeros(3) if source.emissiveFactor is None else np.asarray(source.emissiveFactor)
    if not (factor * strength > 0).any():
        return {}
    texture = color_texture(source.emissiveTexture, name, parts)
    if texture is not None and not texture.any():
        return {}
    red, green, blue = (float(value) for value in factor[:3] * strength)
    return {"emission": (red, green, blue), "emission_texture": texture}


def _normals(source: Any, name: str, parts: Sequence[MeshPart], scale: float) -> np.ndarray | None:
    """Return the normal map with its scale worked in; None where it is flat."""
    if source.normalTexture is None or parts[0].uvs is None:
        return None
    pixels = rgb_pixels(source.normalTexture, name)
    tilt = pixels[..., :2].astype(np.int16) - FLAT
    if np.abs(tilt).max() <= 1 or scale == 0:
        return None
    if scale != 1:
        tilt = np.clip(np.rint(tilt * scale), -FLAT, 255 - FLAT)
        pixels = np.concatenate([(tilt + FLAT).astype(np.uint8), pixels[..., 2:]], axis=-1)
    return np.ascontiguousarray(pixels)


def _scaled(pixels: np.ndarray, factor: np.ndarray | float) -> np.ndarray:
    return np.rint(np.clip(pixels * factor, 0, 255)).astype(np.uint8)
