"""What trimesh leaves out of glTF materials: extensions, strengths, and transforms of texture coordinates."""

from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.sim.scene.mesh.gltf import SPLATS, GltfNumbers, image_bytes
from digs_warp.sim.scene.scene import DIELECTRIC_IOR, DIELECTRIC_REFLECTANCE
from digs_warp.words import cut, quoted

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


@dataclass(frozen=True)
class MapPlace:
    """Where one map of a material lies.

    Attributes:
        uv_set: number of the set of texture coordinates.
        offset, rotation, scale: of KHR_texture_transform; the rotation in radians.
    """

    uv_set: int = 0
    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)

    @property
    def moves(self) -> bool:
        """Whether it changes the coordinates."""
        return (self.offset, self.rotation, self.scale) != ((0.0, 0.0), 0.0, (1.0, 1.0))


def map_places(material: dict[str, Any]) -> list[MapPlace]:
    """Return where the maps of a material lie, each place once, that of its base color first."""
    return list(dict.fromkeys(_place(entry) for entry in _map_entries(material)))


def placed_uvs(
    header: dict[str, Any], primitive: dict[str, Any], numbers: GltfNumbers
) -> np.ndarray | None:
    """Return the texture coordinates with which a primitive shows its first map, shape (n, 2), float32.

    None: they are those of the first set. A renderer that has one set of coordinates lays all maps there.
    """
    if "material" not in primitive:
        return None
    place = next(iter(map_places(header["materials"][primitive["material"]])), MapPlace())
    name = f"TEXCOORD_{place.uv_set}"
    if name not in primitive["attributes"] or not (place.moves or place.uv_set):
        return None
    uvs = numbers.values(primitive["attributes"][name]).astype(np.float64)
    return _moved(uvs, place).astype(np.float32)


def _moved(uvs: np.ndarray, place: MapPlace) -> np.ndarray:
    """Scale, turn and shift coordinates whose v points down, counterclockwise as the image is seen."""
    cos, sin = np.cos(place.rotation), np.sin(place.rotation)
    turn = np.array([[cos, sin], [-sin, cos]])
    return (uvs * place.scale) @ turn.T + place.offset


def _map_entries(material: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the entries of the maps that the renderer draws."""
    pbr = material.get("pbrMetallicRoughness", {})
    extensions = material.get("extensions", {})
    glossy = extensions.get("KHR_materials_pbrSpecularGlossiness", {})
    entries = [
        pbr.get("baseColorTexture"),
        glossy.get("diffuseTexture"),
        pbr.get("metallicRoughnessTexture"),
        material.get("normalTexture"),
        material.get("emissiveTexture"),
        extensions.get("KHR_materials_transmission", {}).get("transmissionTexture"),
    ]
    yield from (entry for entry in entries if entry)


def _place(entry: dict[str, Any]) -> MapPlace:
    transform = entry.get("extensions", {}).get("KHR_texture_transform", {})
    u, v = transform.get("offset", (0.0, 0.0))
    width, height = transform.get("scale", (1.0, 1.0))
    return MapPlace(
        uv_set=int(transform.get("texCoord", entry.get("texCoord", 0))),
        offset=(float(u), float(v)),
        rotation=float(transform.get("rotation", 0.0)),
        scale=(float(width), float(height)),
    )


# Extensions that a file may require because they are read, or change nothing that is drawn here.
READ_EXTENSIONS = {
    *("KHR_mesh_quantization", "KHR_texture_transform", "EXT_texture_webp", "KHR_lights_punctual"),
    *("KHR_materials_clearcoat", "KHR_materials_emissive_strength", "KHR_materials_ior"),
    *("KHR_materials_pbrSpecularGlossiness", "KHR_materials_sheen", "KHR_materials_specular"),
    *("KHR_materials_transmission", "KHR_materials_unlit", "KHR_materials_volume"),
    "KHR_materials_variants",
}


def unmodeled_features(header: dict[str, Any]) -> Iterator[str]:
    """Yield a sentence for all that will look different from what its author intended."""
    for index, material in enumerate(header.get("materials", [])):
        if len(map_places(material)) > 1:
            label = f"material {quoted(str(material.get('name', index)))}"
            yield f"{label}: its maps lie in different places, drawn where its first one lies"
    for extension in sorted({*header.get("extensionsRequired", [])} - READ_EXTENSIONS):
        yield f"it requires {cut(extension)}, which is not read; it may look different"
    primitives = [each for mesh in header.get("meshes", []) for each in mesh["primitives"]]
    if any(SPLATS in each.get("extensions", {}) for each in primitives):
        yield "its Gaussian splats are not read; drawn without them"
    if "EXT_mesh_gpu_instancing" in header.get("extensionsUsed", []):
        yield "its instances are not read; each drawn once"
    shown = [*header.get("nodes", []), *header.get("meshes", [])]
    if any(weight for entry in shown for weight in entry.get("weights", [])):
        yield "morph targets are not read; drawn in its basic shape"
