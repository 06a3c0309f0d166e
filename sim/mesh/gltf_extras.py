"""What trimesh leaves out of glTF materials: transmission, strength of emission, scale of normal maps."""

import base64
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from digs_warp.sim.mesh.gltf_header import glb_binary


@dataclass(frozen=True, eq=False)
class GltfExtras:
    """Of one material.

    Attributes:
        transmission: factor of KHR_materials_transmission.
        transmission_image: PIL image whose red channel multiplies it; None: none.
        emissive_strength: of KHR_materials_emissive_strength.
        normal_scale: of the normal map.
    """

    transmission: float = 0.0
    transmission_image: Any = None
    emissive_strength: float = 1.0
    normal_scale: float = 1.0


def read_extras(path: Path, header: dict[str, Any]) -> dict[str, GltfExtras]:
    """Return the extras of every named material of a .gltf or .glb file.

    Raises:
        OSError, ValueError, KeyError, IndexError: a texture of the extras cannot be read.
    """
    extras = {}
    for material in header.get("materials", []):
        extensions = material.get("extensions", {})
        transmission = extensions.get("KHR_materials_transmission", {})
        strength = extensions.get("KHR_materials_emissive_strength", {})
        texture = transmission.get("transmissionTexture")
        extras[str(material.get("name"))] = GltfExtras(
            transmission=float(transmission.get("transmissionFactor", 0.0)),
            transmission_image=None if texture is None else _image(path, header, texture["index"]),
            emissive_strength=float(strength.get("emissiveStrength", 1.0)),
            normal_scale=float(material.get("normalTexture", {}).get("scale", 1.0)),
        )
    return extras


def _image(path: Path, header: dict[str, Any], texture: int) -> Any:
    """Return the PIL image of a texture."""
    from PIL import Image

    entry = header["images"][header["textures"][texture]["source"]]
    if "uri" in entry:
        return Image.open(BytesIO(_uri_bytes(path, entry["uri"])))
    view = header["bufferViews"][entry["bufferView"]]
    buffer = header["buffers"][view["buffer"]]
    data = _uri_bytes(path, buffer["uri"]) if "uri" in buffer else glb_binary(path)
    start = view.get("byteOffset", 0)
    return Image.open(BytesIO(data[start : start + view["byteLength"]]))


def _uri_bytes(path: Path, uri: str) -> bytes:
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    return (path.parent / unquote(uri)).read_bytes()
