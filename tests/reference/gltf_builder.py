"""Writes GLB files by hand, with what trimesh's own writer does not have."""

import json
import struct
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

_COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}

# A rectangle of 0.3 m by 0.2 m that shows a whole texture; v points down in glTF.
CORNERS = np.array([[0, 0, 0], [0.3, 0, 0], [0.3, 0.2, 0], [0, 0.2, 0]], np.float32)
UVS = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)


class GltfBuilder:
    """One mesh with one primitive, the rectangle, and one material without a name."""

    def __init__(self) -> None:
        self._data = b""
        self.header: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "accessors": [],
            "bufferViews": [],
            "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0}}],
        }
        attributes = {"POSITION": self.add(CORNERS), "TEXCOORD_0": self.add(UVS)}
        triangles = self.add(np.array([0, 1, 2, 0, 2, 3], np.uint16))
        primitive = {"attributes": attributes, "indices": triangles, "material": 0}
        self.header["meshes"] = [{"primitives": [primitive]}]

    @property
    def primitive(self) -> dict[str, Any]:
        return self.header["meshes"][0]["primitives"][0]

    @property
    def material(self) -> dict[str, Any]:
        return self.header["materials"][0]

    def view(self, data: bytes) -> int:
        """Append bytes; return the number of their view."""
        self._data += b"\0" * (-len(self._data) % 4)
        place = {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(data)}
        self._data += data
        self.header["bufferViews"].append(place)
        return len(self.header["bufferViews"]) - 1

    def add(self, values: np.ndarray, normalized: bool = False, **more: Any) -> int:
        """Append an accessor; return its number."""
        rows = values.reshape(len(values), -1)
        accessor = {
            "bufferView": self.view(np.ascontiguousarray(rows).tobytes()),
            "componentType": _COMPONENTS[rows.dtype.str[1:]],
            "count": len(rows),
            "type": _TYPES[rows.shape[1]],
            **({"normalized": True} if normalized else {}),
            **more,
        }
        self.header["accessors"].append(accessor)
        return len(self.header["accessors"]) - 1

    def add_texture(self, image: Image.Image, kind: str = "PNG") -> int:
        """Append an image and a texture that shows it; return the number of the texture."""
        file = BytesIO()
        image.save(file, kind)
        images = self.header.setdefault("images", [])
        images.append(
            {"bufferView": self.view(file.getvalue()), "mimeType": f"image/{kind.lower()}"}
        )
        textures = self.header.setdefault("textures", [])
        textures.append({"source": len(images) - 1})
        return len(textures) - 1

    def save(self, path: Path) -> Path:
        """Write the file."""
        data = self._data + b"\0" * (-len(self._data) % 4)
        others = self.header.get("buffers", [])[1:]
        self.header["buffers"] = [{"byteLength": len(data)}, *others]
        path.write_bytes(glb_bytes(json.dumps(self.header).encode(), data))
        return path


def glb_bytes(header: bytes, data: bytes) -> bytes:
    """Return a file of a header in JSON and of binary data."""
    header += b" " * (-len(header) % 4)
    body = struct.pack("<I4s", len(header), b"JSON") + header
    body += struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body
