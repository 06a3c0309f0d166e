"""glTF geometry rewritten so that trimesh reads it: quantized and sparse accessors, fans, skins.

trimesh takes integers that stand for shares of a whole for the numbers themselves, knows neither sparse
accessors, triangle fans, texture transforms nor a second set of texture coordinates, and loses what hangs on
a camera. Skins are in `digs_warp.sim.scene.mesh.gltf_geometry`.
"""

import base64
import json
from collections.abc import Callable, Iterator
from copy import deepcopy
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.sim.scene.mesh.gltf import GLB_CHUNK, GLB_HEADER, GLB_MAGIC, GltfNumbers, glb_binary
from digs_warp.sim.scene.mesh.gltf_materials import placed_uvs

AddAccessor = Callable[[np.ndarray], int]


def bake_skins(header: dict[str, Any], numbers: GltfNumbers, add: AddAccessor) -> None:
    """Replace every skinned mesh that the scene shows by a still one.

    Args:
        header: of the file; changed in place.
        numbers: of the file.
        add: appends an accessor to the header and returns its number.
    """
    nodes = header.get("nodes", [])
    skinned = [node for node in nodes if "mesh" in node and "skin" in node]
    if not skinned:
        return
    world_from_node = _world_from_node(nodes)
    scene = header["scenes"][header.get("scene", 0)]
    shown = _shown(nodes, scene.get("nodes", []))
    for number, node in enumerate(list(nodes)):
        if "mesh" not in node or "skin" not in node:
            continue
        source, skin = header["meshes"][node.pop("mesh")], header["skins"][node.pop("skin")]
        if number not in shown:
            continue
        joints = np.stack([world_from_node[joint] for joint in skin["joints"]])
        if "inverseBindMatrices" in skin:
            stored = numbers.values(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
            joints = joints @ stored[: len(joints)].swapaxes(1, 2)  # stored by columns
        primitives = [_still(each, joints, numbers, add) for each in source["primitives"]]
        header["meshes"].append({**source, "primitives": primitives})
        nodes.append({"mesh": len(header["meshes"]) - 1})
        scene["nodes"].append(len(nodes) - 1)


def _still(
    primitive: dict[str, Any], world_from_bind: np.ndarray, numbers: GltfNumbers, add: AddAccessor
) -> dict[str, Any]:
    """Return a primitive whose vertices stand where its joints hold them."""
    attributes = dict(primitive["attributes"])
    sets = [name[len("JOINTS_") :] for name in attributes if name.startswith("JOINTS_")]
    if not sets:
        return primitive
    joints = np.concatenate([numbers.values(attributes[f"JOINTS_{each}"]) for each in sets], 1)
    weights = np.concatenate([numbers.values(attributes[f"WEIGHTS_{each}"]) for each in sets], 1)
    weights = weights.astype(np.float64)
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), np.finfo(np.float32).tiny)
    for name, is_point in (("POSITION", True), ("NORMAL", False)):
        if name not in attributes:
            continue
        rows = numbers.values(attributes[name]).astype(np.float64)
        moved = np.zeros_like(rows)
        for joint, weight in zip(joints.T, weights.T, strict=True):
            matrices = world_from_bind[joint]
            one = np.einsum("nij,nj->ni", matrices[:, :3, :3], rows)
            moved += weight[:, None] * (one + matrices[:, :3, 3] * is_point)
        attributes[name] = add(moved.astype(np.float32))
    return {**primitive, "attributes": attributes}


def _world_from_node(nodes: list[dict[str, Any]]) -> list[np.ndarray]:
    """Return the placement of every node, (4, 4)."""
    parents = {
        child: number for number, node in enumerate(nodes) for child in node.get("children", [])
    }
    placed = []
    for number, node in enumerate(nodes):
        matrix, seen = _parent_from_node(node), {number}
        while number in parents and parents[number] not in seen:
            number = parents[number]
            seen.add(number)
            matrix = _parent_from_node(nodes[number]) @ matrix
        placed.append(matrix)
    return placed


def _parent_from_node(node: dict[str, Any]) -> np.ndarray:
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T  # stored by columns
    matrix = np.eye(4)
    turn = matrix_from_quat_xyzw(np.array(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), np.float64))
    matrix[:3, :3] = turn * np.asarray(node.get("scale", (1.0, 1.0, 1.0)), np.float64)
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def _shown(nodes: list[dict[str, Any]], roots: list[int]) -> set[int]:
    """Return the nodes that a scene with these roots shows."""
    shown: set[int] = set()
    waiting = list(roots)
    while waiting:
        number = waiting.pop()
        if number not in shown:
            shown.add(number)
            waiting += nodes[number].get("children", [])
    return shown


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
