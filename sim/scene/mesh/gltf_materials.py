"""Materials of glTF files, with the extensions that change how a surface looks, as `Material`."""

import logging
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import MeshError
from digs_warp.sim.scene.mesh.files_beside import UndecodableError, check_texture
from digs_warp.sim.scene.mesh.gltf import SPLATS, GltfNumbers, image_bytes, image_of
from digs_warp.sim.scene.mesh.materials import (
    MIN_OPACITY,
    alpha_pixels,
    color_texture,
    mean_over_surface,
    rgb_pixels,
)
from digs_warp.sim.scene.mesh.parts import MeshPart
from digs_warp.sim.scene.scene import Material
from digs_warp.words import cut, quoted

logger = logging.getLogger(__name__)

# glTF's default refractive index, and cut-off for alphaMode MASK.
DEFAULT_IOR = 1.5
DEFAULT_CUTOFF = 0.5

# Zero of x and y in a normal map.
FLAT = 128

GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"

# Extensions of materials whose entries are read beside those of the standard; no two name one alike.
MATERIAL_EXTENSIONS = (
    *("KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_specular"),
    "KHR_materials_transmission",
)
# Those that are drawn without, and how.
PLAIN_EXTENSIONS = {
    "KHR_materials_clearcoat": "without its varnish",
    "KHR_materials_sheen": "without its sheen",
    "KHR_materials_volume": "as a thin wall, which bends no light",
}

Color = tuple[float, float, float]
BLACK: Color = (0.0, 0.0, 0.0)


class GltfMaterials:
    """Converts the materials of a file.

    Args:
        path: of a .gltf or .glb file.
        header: of the file, checked.
    """

    def __init__(self, path: Path, header: dict[str, Any]) -> None:
        self._path, self._header = path, header
        self._damaged = set[int]()
        # By identity: parts name their material by its entry in the header.
        self._names: dict[int, str] = {}
        taken = set[str]()
        for number, material in enumerate(header.get("materials", [])):
            name = material.get("name") or f"material {number}"
            self._names[id(material)] = f"{name} ({number})" if name in taken else name
            taken.add(name)

    def convert(self, entry: dict[str, Any], parts: Sequence[MeshPart]) -> Material:
        """Return a material of the header that all ``parts`` share; factors are linear and default to 1.

        Raises:
            MeshError: its base color cannot be decoded.
        """
        name, values = self._names[id(entry)], self._values(entry)
        image = self._image(values.get("baseColorTexture"))
        if image is None and "baseColorTexture" in values:
            raise MeshError(
                f"mesh '{self._path}': the texture of material {quoted(name)} cannot be decoded; "
                "export it again with PNG or JPEG textures"
            )
        factor = np.array(values.get("baseColorFactor", np.ones(4)), np.float64)
        ior = max(float(values.get("ior", DEFAULT_IOR)), 1.0)
        specular = float(values.get("specularFactor", 1.0)) * ((ior - 1) / (ior + 1)) ** 2
        return Material(
            name=name,
            base_color=factor[:3].astype(np.float32),
            texture=color_texture(image, name, parts),
            **self._finish(values, name, parts),
            **_opacity(values, float(factor[3]), image, name, parts),
            **self._transmission(values, name, parts),
            reflectance=float(np.clip(specular, 0.0, 1.0)),
            **self._emission(values, name, parts),
            normal_texture=self._normals(values, name, parts),
        )

    def _values(self, entry: dict[str, Any]) -> dict[str, Any]:
        """Return all entries of a material in one mapping; maps are entries of the header, or PIL images."""
        extensions = entry.get("extensions", {})
        values = {**entry, **entry.get("pbrMetallicRoughness", {})}
        for each in MATERIAL_EXTENSIONS:
            values |= extensions.get(each, {})
        if GLOSSINESS in extensions:
            from trimesh.visual.gloss import specular_to_pbr

            glossy = extensions[GLOSSINESS]
            maps = {k: self._image(v) for k, v in glossy.items() if k.endswith("Texture")}
            values |= specular_to_pbr(**{**glossy, **maps})
        if "KHR_materials_unlit" in extensions:
            # What knows no light does not shine like metal, which is the default.
            values.setdefault("metallicFactor", 0.0)
        return values

    def _image(self, entry: Any) -> Any:
        """Return the PIL image of a map; None: there is none, or a warning has said that it is damaged."""
        if not isinstance(entry, dict):
            return entry
        from PIL import Image

        number = image_of(self._header["textures"][entry["index"]])
        if number is None:
            return None
        image = self._header["images"][number]
        data = image_bytes(self._path, self._header, image)
        try:
            check_texture(
                f"image {number} {quoted(image.get('name') or image.get('uri', ''))}", data
            )
        except UndecodableError as error:
            if number not in self._damaged:
                logger.warning("mesh '%s': %s; drawn without it", self._path.name, error)
            self._damaged.add(number)
            return None
        return Image.open(BytesIO(data))

    def _finish(
        self, values: dict[str, Any], name: str, parts: Sequence[MeshPart]
    ) -> dict[str, Any]:
        """Return roughness and metallic, and their texture where they vary."""
        factors = np.array([values.get(f"{each}Factor", 1.0) for each in ("roughness", "metallic")])
        texture, image = None, self._image(values.get("metallicRoughnessTexture"))
        if image is not None and parts[0].uvs is not None:
            pixels = rgb_pixels(image, name)[..., 1:]
            texture = _scaled(pixels, factors) if np.ptp(pixels, axis=(0, 1)).any() else None
            factors = factors * mean_over_surface(pixels, parts) / 255.0
        roughness, metallic = np.clip(factors, 0.0, 1.0).tolist()
        return {"roughness": roughness, "metallic": metallic, "finish_texture": texture}

    def _transmission(
        self, values: dict[str, Any], name: str, parts: Sequence[MeshPart]
    ) -> dict[str, Any]:
        """Return transmission, and its texture where it varies."""
        factor = float(values.get("transmissionFactor", 0.0))
        image = self._image(values.get("transmissionTexture"))
        if factor <= 0 or image is None or parts[0].uvs is None:
            return {"transmission": max(factor, 0.0)}
        pixels = _scaled(rgb_pixels(image, name)[..., 0], factor)
        mean = float(mean_over_surface(pixels[..., None], parts)[0] / 255.0)
        return {"transmission": mean, "transmission_texture": pixels}

    def _emission(
        self, values: dict[str, Any], name: str, parts: Sequence[MeshPart]
    ) -> dict[str, Any]:
        """Return the emission and its texture; nothing for materials that do not glow."""
        strength = float(values.get("emissiveStrength", 1.0))
        factor = np.array(values.get("emissiveFactor", BLACK), np.float64) * strength
        if not (factor > 0).any():
            return {}
        texture = color_texture(self._image(values.get("emissiveTexture")), name, parts)
        if texture is not None and not texture.any():
            return {}
        return {"emission": _color(factor), "emission_texture": texture}

    def _normals(
        self, values: dict[str, Any], name: str, parts: Sequence[MeshPart]
    ) -> np.ndarray | None:
        """Return the normal map with its scale worked in; None where it is flat."""
        entry = values.get("normalTexture")
        image, scale = self._image(entry), float((entry or {}).get("scale", 1.0))
        if image is None or parts[0].uvs is None:
            return None
        pixels = rgb_pixels(image, name)
        tilt = pixels[..., :2].astype(np.int16) - FLAT
        if np.abs(tilt).max() <= 1 or scale == 0:
            return None
        if scale != 1:
            tilt = np.clip(np.rint(tilt * scale), -FLAT, 255 - FLAT)
            pixels = np.concatenate([(tilt + FLAT).astype(np.uint8), pixels[..., 2:]], axis=-1)
        return np.ascontiguousarray(pixels)


def _opacity(
    values: dict[str, Any], factor: float, image: Any, name: str, parts: Sequence[MeshPart]
) -> dict[str, Any]:
    """Return opacity, its texture where it varies, and the cut-off; nothing for opaque materials."""
    mode = values.get("alphaMode", "OPAQUE")
    if mode == "OPAQUE":
        return {}
    alpha = None if image is None or parts[0].uvs is None else alpha_pixels(image, name)
    if mode == "MASK":
        cutoff = float(values.get("alphaCutoff", DEFAULT_CUTOFF))
        if alpha is not None:
            alpha = np.where(alpha / 255.0 * factor >= cutoff, 255, 0).astype(np.uint8)
        factor = 1.0 if factor >= cutoff or alpha is not None else 0.0
    if alpha is None:
        return {"opacity": factor}
    alpha = _scaled(alpha, factor)
    return {
        "opacity": float(mean_over_surface(alpha[..., None], parts)[0] / 255.0),
        "opacity_texture": alpha,
        "alpha_cutoff": DEFAULT_CUTOFF if mode == "MASK" else MIN_OPACITY,
    }


def _color(values: np.ndarray) -> Color:
    red, green, blue = values[:3].tolist()
    return red, green, blue


def _scaled(pixels: np.ndarray, factor: np.ndarray | float) -> np.ndarray:
    return np.rint(np.clip(pixels * factor, 0, 255)).astype(np.uint8)


# Set of texture coordinates, and offset, rotation [rad] and scale of KHR_texture_transform.
MapPlace = tuple[int, tuple[float, float], float, tuple[float, float]]
FIRST_SET: MapPlace = (0, (0.0, 0.0), 0.0, (1.0, 1.0))


def _place(entry: dict[str, Any]) -> MapPlace:
    """Return the place that the entry of a map names."""
    transform = entry.get("extensions", {}).get("KHR_texture_transform", {})
    u, v = transform.get("offset", (0.0, 0.0))
    width, height = transform.get("scale", (1.0, 1.0))
    uv_set = int(transform.get("texCoord", entry.get("texCoord", 0)))
    rotation = float(transform.get("rotation", 0.0))
    return uv_set, (float(u), float(v)), rotation, (float(width), float(height))


def map_places(material: dict[str, Any]) -> list[MapPlace]:
    """Return where the maps that are drawn lie, each place once, that of the base color first."""
    pbr, extensions = material.get("pbrMetallicRoughness", {}), material.get("extensions", {})
    entries = (
        pbr.get("baseColorTexture"),
        extensions.get(GLOSSINESS, {}).get("diffuseTexture"),
        pbr.get("metallicRoughnessTexture"),
        material.get("normalTexture"),
        material.get("emissiveTexture"),
        extensions.get("KHR_materials_transmission", {}).get("transmissionTexture"),
    )
    return list(dict.fromkeys(_place(entry) for entry in entries if entry))


def placed_uvs(
    material: dict[str, Any], attributes: dict[str, int], numbers: GltfNumbers
) -> np.ndarray | None:
    """Return the texture coordinates with which a primitive shows its first map, (n, 2); v = 0 is the bottom.

    None: it has none. A renderer that has one set of coordinates lays all maps there.
    """
    uv_set, offset, rotation, scale = next(iter(map_places(material)), FIRST_SET)
    if f"TEXCOORD_{uv_set}" not in attributes:
        uv_set, offset, rotation, scale = FIRST_SET
    if (name := f"TEXCOORD_{uv_set}") not in attributes:
        return None
    uvs = numbers.values(attributes[name]).astype(np.float64)
    cos, sin = np.cos(rotation), np.sin(rotation)
    # Scaled, turned and shifted; v still points down, so that this is counterclockwise as the image is seen.
    uvs = (uvs * scale) @ np.array([[cos, -sin], [sin, cos]]) + offset
    uvs = uvs.astype(np.float32)
    return np.stack([uvs[:, 0], np.float32(1) - uvs[:, 1]], axis=1).astype(np.float64)


# Extensions that a file may require because they are read, or change nothing that is drawn here.
READ_EXTENSIONS = {
    *MATERIAL_EXTENSIONS,
    *PLAIN_EXTENSIONS,
    *("KHR_mesh_quantization", "KHR_texture_transform", "EXT_texture_webp", "KHR_lights_punctual"),
    *(GLOSSINESS, "KHR_materials_unlit", "KHR_materials_variants"),
}


def unmodeled_features(header: dict[str, Any]) -> Iterator[str]:
    """Yield a sentence for all that will look different from what its author intended."""
    for index, material in enumerate(header.get("materials", [])):
        label = f"material {quoted(str(material.get('name', index)))}"
        for extension in sorted(PLAIN_EXTENSIONS.keys() & material.get("extensions", {})):
            yield f"{label}: drawn {PLAIN_EXTENSIONS[extension]} ({extension})"
        if len(map_places(material)) > 1:
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
