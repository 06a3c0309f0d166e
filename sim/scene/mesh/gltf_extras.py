"""What trimesh leaves out of glTF materials: glass, varnish, cloth, strength of light and normals."""

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.sim.scene.mesh.gltf import image_bytes
from digs_warp.sim.scene.scene import DIELECTRIC_IOR, DIELECTRIC_REFLECTANCE

# Attenuation colors are not darker: black would absorb without limit.
DARKEST = 1e-4


@dataclass(frozen=True, eq=False)
class GltfExtras:
    """Of one material.

    Attributes:
        transmission: factor of KHR_materials_transmission.
        transmission_image: PIL image whose red channel multiplies it; None: none.
        ior: of KHR_materials_ior.
        reflectance: at normal incidence, by that and the factor of KHR_materials_specular.
        absorption: of KHR_materials_volume, linear RGB per unit of the file; None: a thin wall.
        clear_coat: factor of KHR_materials_clearcoat.
        clear_coat_image: PIL image whose red channel multiplies it; None: none.
        clear_coat_roughness: of that layer.
        sheen: color of KHR_materials_sheen, linear RGB.
        sheen_image: PIL image, sRGB, that multiplies it; None: none.
        sheen_roughness: of the fibers.
        emissive_strength: of KHR_materials_emissive_strength.
        normal_scale: of the normal map.
    """

    transmission: float = 0.0
    transmission_image: Any = None
    ior: float = DIELECTRIC_IOR
    reflectance: float = DIELECTRIC_REFLECTANCE
    absorption: tuple[float, float, float] | None = None
    clear_coat: float = 0.0
    clear_coat_image: Any = None
    clear_coat_roughness: float = 0.0
    sheen: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sheen_image: Any = None
    sheen_roughness: float = 0.0
    emissive_strength: float = 1.0
    normal_scale: float = 1.0


def read_extras(path: Path, header: dict[str, Any]) -> dict[str, GltfExtras]:
    """Return the extras of every named material of a .gltf or .glb file.

    Raises:
        OSError, ValueError, KeyError, IndexError: a texture cannot be read.
    """
    extras = {}
    for material in header.get("materials", []):
        extensions = material.get("extensions", {})
        transmission = extensions.get("KHR_materials_transmission", {})
        strength = extensions.get("KHR_materials_emissive_strength", {})
        clear_coat = extensions.get("KHR_materials_clearcoat", {})
        sheen = extensions.get("KHR_materials_sheen", {})
        ior = max(float(extensions.get("KHR_materials_ior", {}).get("ior", DIELECTRIC_IOR)), 1.0)
        specular = float(extensions.get("KHR_materials_specular", {}).get("specularFactor", 1.0))
        extras[str(material.get("name"))] = GltfExtras(
            transmission=float(transmission.get("transmissionFactor", 0.0)),
            transmission_image=_image(path, header, transmission.get("transmissionTexture")),
            ior=ior,
            reflectance=float(np.clip(specular * ((ior - 1) / (ior + 1)) ** 2, 0.0, 1.0)),
            absorption=_absorption(extensions.get("KHR_materials_volume", {})),
            clear_coat=_share(clear_coat.get("clearcoatFactor", 0.0)),
            clear_coat_image=_image(path, header, clear_coat.get("clearcoatTexture")),
            clear_coat_roughness=_share(clear_coat.get("clearcoatRoughnessFactor", 0.0)),
            sheen=_sheen_color(sheen),
            sheen_image=_image(path, header, sheen.get("sheenColorTexture")),
            sheen_roughness=_share(sheen.get("sheenRoughnessFactor", 0.0)),
            emissive_strength=float(strength.get("emissiveStrength", 1.0)),
            normal_scale=float(material.get("normalTexture", {}).get("scale", 1.0)),
        )
    return extras


def _absorption(volume: dict[str, Any]) -> tuple[float, float, float] | None:
    """Return the absorption of a body per unit of the file, by Beer and Lambert; None: a thin wall.

    Light has its attenuation color after the attenuation distance; without one nothing is absorbed.
    """
    if not float(volume.get("thicknessFactor", 0.0)) > 0:
        return None
    distance = float(volume.get("attenuationDistance", np.inf))
    color = np.asarray(volume.get("attenuationColor", (1.0, 1.0, 1.0)), dtype=np.float64)
    if not distance > 0:
        return 0.0, 0.0, 0.0
    red, green, blue = -np.log(np.clip(color, DARKEST, 1.0)) / distance
    return float(red), float(green), float(blue)


def _share(value: Any) -> float:
    return float(np.clip(float(value), 0.0, 1.0))


def _sheen_color(sheen: dict[str, Any]) -> tuple[float, float, float]:
    red, green, blue = (_share(value) for value in sheen.get("sheenColorFactor", (0.0, 0.0, 0.0)))
    return red, green, blue


def _image(path: Path, header: dict[str, Any], texture: dict[str, Any] | None) -> Any:
    """Return the PIL image of a texture that the header names; None: it names none."""
    if texture is None:
        return None
    from PIL import Image

    of_texture = header["textures"][texture["index"]]
    webp = of_texture.get("extensions", {}).get("EXT_texture_webp", {})
    entry = header["images"][webp.get("source", of_texture.get("source"))]
    return Image.open(BytesIO(image_bytes(path, header, entry)))
