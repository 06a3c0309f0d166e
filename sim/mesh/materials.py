"""Materials of trimesh (glTF and MTL) as `digs_warp.sim.scene.Material`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from digs_warp.data.images import linear_from_srgb
from digs_warp.sim.mesh.gltf_extras import GltfExtras
from digs_warp.sim.mesh.parts import MeshPart
from digs_warp.sim.mesh.pbr import MIN_OPACITY, pbr_material
from digs_warp.sim.mesh.pixels import alpha_pixels
from digs_warp.sim.mesh.texture import color_texture
from digs_warp.sim.scene import Material

# What a mesh without any colour is drawn in: light grey clay, linear.
PLAIN_COLOR = (0.4, 0.4, 0.4)
PLAIN_ROUGHNESS = 0.8


def materials_of_parts(
    parts: Sequence[MeshPart], extras: Mapping[str, GltfExtras]
) -> tuple[tuple[Material, ...], list[int]]:
    """Return the materials, each once, and the index of the material of every part.

    Args:
        parts: with the materials of trimesh.
        extras: what trimesh leaves out, by the name of the material.
    """
    groups: dict[object, list[MeshPart]] = {}
    for part in parts:
        groups.setdefault(_key(part), []).append(part)
    numbers = {key: number for number, key in enumerate(groups)}
    materials = tuple(_material(group, extras) for group in groups.values())
    return materials, [numbers[_key(part)] for part in parts]


def _key(part: MeshPart) -> tuple[int, bool, bool]:
    """Tell materials apart; parts without coordinates cannot use the texture of the others."""
    return id(part.material), part.uvs is not None, part.colored


def _material(parts: list[MeshPart], extras: Mapping[str, GltfExtras]) -> Material:
    """Convert the material that all ``parts`` share."""
    from trimesh.visual.material import PBRMaterial, SimpleMaterial

    source = parts[0].material
    if isinstance(source, PBRMaterial):
        return pbr_material(source, parts, extras.get(str(source.name), GltfExtras()))
    if isinstance(source, SimpleMaterial) and not _is_empty(source):
        return _simple_material(source, parts)
    color = (1.0, 1.0, 1.0) if parts[0].colored else PLAIN_COLOR
    return Material("plain", np.array(color, np.float32), roughness=PLAIN_ROUGHNESS)


def _is_empty(source: Any) -> bool:
    """Whether trimesh made up a material for a mesh that has texture coordinates but no material."""
    return source.image is None and not source.kwargs and source.name == "material_0"


def _simple_material(source: Any, parts: list[MeshPart]) -> Material:
    """Convert a material of an MTL file: colours are sRGB, as most programs take them.

    With a texture the diffuse colour does not count: exporters leave anything there, even black.
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
        **_opacity(source, name, texture is not None),
    )


def _opacity(source: Any, name: str, textured: bool) -> dict[str, Any]:
    """Return opacity from an MTL's ``d`` or ``Tr`` and from the alpha of its texture."""
    try:
        transparency = 1.0 - float(source.kwargs.get("tr", ["0"])[-1])
        opacity = float(source.kwargs.get("d", [transparency])[-1])
    except ValueError:
        opacity = 1.0
    opacity = float(np.clip(opacity, 0.0, 1.0))
    alpha = alpha_pixels(source.image, name) if textured else None
    if alpha is None:
        return {"opacity": opacity}
    return {
        "opacity": opacity * float(alpha.mean()) / 255.0,
        "opacity_texture": np.rint(alpha * opacity).astype(np.uint8),
        "alpha_cutoff": MIN_OPACITY,
    }
