"""glTF in plainer words: what trimesh would leave out or misread, written so that it does not.

trimesh takes integers that stand for shares of a whole for the numbers themselves, knows neither sparse
accessors, triangle fans, texture transforms nor a second set of texture coordinates, and loses what hangs on
a camera. Skins are in `digs_warp.sim.scene.mesh.gltf_skins`.
"""

import base64
import json
from collections.abc import Iterator
from copy import deepcopy
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.sim.scene.mesh.gltf import GLB_CHUNK, GLB_HEADER, GLB_MAGIC, glb_binary
from digs_warp.sim.scene.mesh.gltf_numbers import GltfNumbers
from digs_warp.sim.scene.mesh.gltf_skins import bake_skins
from digs_warp.sim.scene.mesh.gltf_uvs import placed_uvs

_TRIANGLES, _FAN = 4, 6
_GEOMETRY = ("POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0")


def plain_header(path: Path, header: dict[str, Any]) -> dict[str, Any]:
    """Return a header that says the same in words that trimesh understands.

    Args:
        path: a .gltf or .glb file.
        header: of the file; if there is nothing to change, it is returned itself.
    """
    plain = deepcopy(header)
    numbers = GltfNumbers(path, plain)
    extra = _ExtraBuffer(plain)
    _name_materials(plain)
    _take_unlit_for_plain(plain)
    for node in plain.get("nodes", []):
        node.pop("camera", None)
    bake_skins(plain, numbers, extra.add)
    for primitive in _primitives(plain):
        placed = placed_uvs(plain, primitive, numbers)
        if placed is not None:
            primitive["attributes"]["TEXCOORD_0"] = extra.add(placed)
        if primitive.get("mode") == _FAN:
            _open_fan(primitive, numbers, extra)
        _read_plainly(primitive, numbers, extra)
    extra.close()
    return header if plain == header else plain


def file_with_header(path: Path, header: dict[str, Any]) -> BytesIO:
    """Return the file with another header."""
    text = json.dumps(header).encode()
    if path.suffix.lower() != ".glb":
        return BytesIO(text)
    text += b" " * (-len(text) % 4)
    data = glb_binary(path) if any("uri" not in each for each in header["buffers"]) else b""
    chunks = [GLB_CHUNK.pack(len(text), b"JSON"), text, GLB_CHUNK.pack(len(data), b"BIN\0"), data]
    length = GLB_HEADER.size + sum(len(each) for each in chunks)
    return BytesIO(b"".join([GLB_HEADER.pack(GLB_MAGIC, 2, length), *chunks]))


class _ExtraBuffer:
    """Collects numbers for one more buffer of a header, which is written as text."""

    def __init__(self, header: dict[str, Any]) -> None:
        self._header = header
        self._pieces: list[bytes] = []
        self._bytes = 0

    def add(self, values: np.ndarray) -> int:
        """Append an accessor for rows of float32 or uint32, shape (n, k); return its number."""
        data = np.ascontiguousarray(values).tobytes()
        views, accessors = self._header["bufferViews"], self._header["accessors"]
        views.append(
            {
                "buffer": len(self._header["buffers"]),
                "byteOffset": self._bytes,
                "byteLength": len(data),
            }
        )
        kind = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[values.shape[1]]
        component = {np.dtype(np.float32): 5126, np.dtype(np.uint32): 5125}[values.dtype]
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": component,
                "count": len(values),
                "type": kind,
            }
        )
        self._pieces.append(data)
        self._bytes += len(data)
        return len(accessors) - 1

    def close(self) -> None:
        """Put the buffer into the header, if anything was added."""
        if self._pieces:
            text = base64.b64encode(b"".join(self._pieces)).decode()
            uri = f"data:application/octet-stream;base64,{text}"
            self._header["buffers"].append({"byteLength": self._bytes, "uri": uri})


def _name_materials(header: dict[str, Any]) -> None:
    """Give every material a unique name, by which its extensions are found again."""
    taken: set[str] = set()
    for number, material in enumerate(header.get("materials", [])):
        name = material.get("name") or f"material {number}"
        material["name"] = name if name not in taken else f"{name} ({number})"
        taken.add(material["name"])


def _take_unlit_for_plain(header: dict[str, Any]) -> None:
    """Keep materials that know no light from shining like metal, which is what glTF assumes by default."""
    for material in header.get("materials", []):
        if "KHR_materials_unlit" in material.get("extensions", {}):
            material.setdefault("pbrMetallicRoughness", {}).setdefault("metallicFactor", 0.0)


def _primitives(header: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for mesh in header.get("meshes", []):
        yield from mesh["primitives"]


def _read_plainly(primitive: dict[str, Any], numbers: GltfNumbers, extra: _ExtraBuffer) -> None:
    """Replace accessors that trimesh would misread."""
    attributes = primitive["attributes"]
    for name in _GEOMETRY:
        if name in attributes and not numbers.is_plain(attributes[name]):
            attributes[name] = extra.add(numbers.values(attributes[name]).astype(np.float32))
    if "indices" in primitive and not numbers.is_plain(primitive["indices"]):
        primitive["indices"] = extra.add(numbers.values(primitive["indices"]).astype(np.uint32))


def _open_fan(primitive: dict[str, Any], numbers: GltfNumbers, extra: _ExtraBuffer) -> None:
    """Write a fan, whose triangles share their first corner, as a list of triangles."""
    if "indices" in primitive:
        corners = numbers.values(primitive["indices"])[:, 0]
    else:
        corners = np.arange(numbers.count(primitive["attributes"]["POSITION"]))
    first = np.full(max(len(corners) - 2, 0), corners[0])
    triangles = np.stack([first, corners[1:-1], corners[2:]], axis=1)
    primitive["indices"] = extra.add(triangles.reshape(-1, 1).astype(np.uint32))
    primitive["mode"] = _TRIANGLES
