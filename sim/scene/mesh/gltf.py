"""The header of a glTF or GLB file, what is wrong with it, and its accessors and images."""

import base64
import struct
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from digs_warp.bounds import GLTF_TEXT, JSON, check_unpacked
from digs_warp.checks import MeshError
from digs_warp.record.fields import parse_json
from digs_warp.words import quoted

# glTF 2.0, section 4.4: 12 bytes of file header, 8 bytes of chunk header, the first chunk is JSON.
GLB_MAGIC = b"glTF"
GLB_HEADER = struct.Struct("<4sII")
GLB_CHUNK = struct.Struct("<I4s")

# Extensions that cannot be read but change geometry or textures, and how to avoid them.
_OTHER_TEXTURES = ("KHR_texture_basisu", "EXT_texture_avif", "MSFT_texture_dds")
UNREADABLE_EXTENSIONS = {
    "KHR_draco_mesh_compression": "export it without Draco compression",
    "EXT_meshopt_compression": "export it without meshopt compression",
    "KHR_meshopt_compression": "export it without meshopt compression",
    "EXT_mesh_gpu_instancing": "export it without GPU instancing",
    **dict.fromkeys(_OTHER_TEXTURES, "export its textures as PNG or JPEG"),
}
SPLATS = "KHR_gaussian_splatting"


def read_gltf_header(path: Path) -> dict[str, Any]:
    """Return the JSON header of a .gltf or .glb file.

    Raises:
        MeshError: not glTF, truncated, or invalid JSON.
    """
    is_binary = path.suffix.lower() == ".glb"
    if not is_binary:
        GLTF_TEXT.check(f"mesh '{path}'", path.stat().st_size)
    data = path.read_bytes()
    text = _glb_json(path, data) if is_binary else data
    if is_binary:
        JSON.check(f"mesh '{path}'", len(text))
    try:
        header = parse_json(text)
    except ValueError as error:
        raise MeshError(
            f"mesh '{path}': its JSON header is broken ({error}); copy or export the file again"
        ) from error
    if not isinstance(header, dict) or "asset" not in header:
        raise MeshError(f"mesh '{path}': not glTF 2.0 (no 'asset' in its header); export it again")
    if isinstance(header.get("scenes"), dict):
        raise MeshError(
            f"mesh '{path}': glTF 1.0, expected 2.0; export it again as glTF 2.0 or GLB"
        )
    _check_scene(path, header)
    return header


def _check_scene(path: Path, header: dict[str, Any]) -> None:
    """Raise a `MeshError` for a file without a scene: by the specification it shows nothing."""
    scenes, number = header.get("scenes"), header.get("scene", 0)
    if not scenes or not isinstance(scenes, list):
        raise MeshError(
            f"mesh '{path}': no scene in it, expected one that shows the object; export it again as a scene"
        )
    if not (isinstance(number, int) and 0 <= number < len(scenes)):
        raise MeshError(
            f"mesh '{path}': scene {number!r} of {len(scenes)} is to be shown, expected 0 to "
            f"{len(scenes) - 1}; export it again"
        )


def _glb_json(path: Path, data: bytes) -> bytes:
    if len(data) < GLB_HEADER.size + GLB_CHUNK.size:
        raise MeshError(f"mesh '{path}': truncated, {len(data)} bytes; copy or export it again")
    magic, version, length = GLB_HEADER.unpack_from(data)
    if magic != GLB_MAGIC or version != 2:
        raise MeshError(
            f"mesh '{path}': starts with {magic!r}, version {version}, expected b'glTF', version 2; "
            "is the suffix right?"
        )
    if len(data) < length:
        raise MeshError(
            f"mesh '{path}': truncated, {len(data)} of {length} bytes; copy or export it again"
        )
    start = GLB_HEADER.size + GLB_CHUNK.size
    chunk_length, _ = GLB_CHUNK.unpack_from(data, GLB_HEADER.size)
    return data[start : start + chunk_length].rstrip(b"\0")  # some programs fill up with zeros


def glb_binary(path: Path) -> bytes:
    """Return the second chunk of a GLB file: the buffer without a URI."""
    data = path.read_bytes()
    start = GLB_HEADER.size
    length, _ = GLB_CHUNK.unpack_from(data, start)
    start += GLB_CHUNK.size + length
    length, _ = GLB_CHUNK.unpack_from(data, start)
    return data[start + GLB_CHUNK.size : start + GLB_CHUNK.size + length]


def check_extensions(path: Path, header: dict[str, Any]) -> None:
    """Raise a `MeshError` for data that cannot be read, without plain data beside it, or for splats alone."""
    lacking = set[str]()

    def check(place: dict[str, Any], has_plain: bool) -> None:
        if not has_plain:
            lacking.update(UNREADABLE_EXTENSIONS.keys() & place.get("extensions", {}))

    accessors, buffers = header.get("accessors", []), header.get("buffers", [])
    primitives = [each for mesh in header.get("meshes", []) for each in mesh["primitives"]]
    for each in primitives:
        numbers = [*each["attributes"].values(), each.get("indices")]
        check(each, all("bufferView" in accessors[n] for n in numbers if n is not None))
    for view in header.get("bufferViews", []):
        buffer = buffers[view["buffer"]]
        stands_in = any(e.get("fallback") for e in buffer.get("extensions", {}).values())
        check(view, "uri" in buffer or not (view["buffer"] or stands_in))
    required = header.get("extensionsRequired", [])
    for node in header.get("nodes", []):
        check(node, "EXT_mesh_gpu_instancing" not in required)
    for texture in header.get("textures", []):
        check(texture, "source" in texture)
    for each in sorted(lacking):
        raise MeshError(
            f"mesh '{path}': uses {each}, which cannot be read, without plain data beside it; "
            f"{UNREADABLE_EXTENSIONS[each]}"
        )
    if primitives and all(SPLATS in each.get("extensions", {}) for each in primitives):
        raise MeshError(
            f"mesh '{path}': Gaussian splats ({SPLATS}), expected triangles; 'digs-warp view', 'convert' "
            "and 'info' read them"
        )


def image_of(texture: dict[str, Any]) -> int | None:
    """Return the number of the image that a texture of the header shows; None: it has none."""
    webp = texture.get("extensions", {}).get("EXT_texture_webp", {})
    return webp.get("source", texture.get("source"))


def shown_images(header: dict[str, Any]) -> dict[int, dict[str, Any]]:
    """Return the images that some texture shows, by number; others may be of an unknown kind."""
    numbers = {image_of(texture) for texture in header.get("textures", [])}
    return {n: image for n, image in enumerate(header.get("images", [])) if n in numbers}


def check_files(path: Path, header: dict[str, Any]) -> None:
    """Raise a `MeshError` if files beside ``path`` are missing."""
    entries = [("buffer", each) for each in header.get("buffers", [])]
    entries += [("image", each) for each in shown_images(header).values()]
    for kind, entry in entries:
        uri = entry.get("uri", "data:")
        if not uri.startswith("data:") and not (path.parent / unquote(uri)).is_file():
            raise MeshError(
                f"mesh '{path}': its {kind} {quoted(unquote(uri))} is missing in '{path.parent}'; copy the "
                "whole folder, or export one GLB file"
            )


def image_bytes(path: Path, header: dict[str, Any], entry: dict[str, Any]) -> bytes:
    """Return the file in one of the header's ``images``."""
    if "uri" in entry:
        return uri_bytes(path, entry["uri"])
    view = header["bufferViews"][entry["bufferView"]]
    buffer = header["buffers"][view["buffer"]]
    data = uri_bytes(path, buffer["uri"]) if "uri" in buffer else glb_binary(path)
    start = view.get("byteOffset", 0)
    return data[start : start + view["byteLength"]]


def uri_bytes(path: Path, uri: str) -> bytes:
    """Return what a URI of the file at ``path`` holds: inline data, or another file."""
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    return (path.parent / unquote(uri)).read_bytes()


# glTF 2.0, section 3.6.2.2: types of components, and components per element.
TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


def check_counts(path: Path, header: dict[str, Any]) -> None:
    """Raise a `DigsError` where accessors, or nodes that show a mesh again and again, promise too much."""
    accessors, meshes = header.get("accessors", []), header.get("meshes", [])
    sizes = [
        COMPONENTS[each["type"]] * (each["count"] + each.get("sparse", {}).get("count", 0)) * 4
        for each in accessors
    ]
    of_mesh = [
        sum(
            sizes[number]
            for each in mesh["primitives"]
            for number in (*each["attributes"].values(), each.get("indices"))
            if number is not None
        )
        for mesh in meshes
    ]
    shown = sum(of_mesh[node["mesh"]] for node in header.get("nodes", []) if "mesh" in node)
    uris = [each.get("uri", "data:") for each in header.get("buffers", [])]
    beside = [path.parent / unquote(uri) for uri in uris if not uri.startswith("data:")]
    held = sum(each.stat().st_size for each in (path, *beside))
    check_unpacked(f"mesh '{path}'", held, sum(sizes) + shown)


def parent_from_node(node: dict[str, Any]) -> np.ndarray:
    """Return the transform of a node, (4, 4), float64."""
    from trimesh.transformations import quaternion_matrix

    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T  # stored by columns
    matrix = quaternion_matrix(np.roll(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), 1))  # wxyz
    matrix[:3, :3] *= np.asarray(node.get("scale", (1.0, 1.0, 1.0)), np.float64)
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


class GltfNumbers:
    """Reads the accessors of a file.

    Args:
        path: the file; its buffers are read relative to its folder.
        header: of the file, with counts that have been checked.
    """

    def __init__(self, path: Path, header: dict[str, Any]) -> None:
        self._path, self._header = path, header

    def values(self, number: int) -> np.ndarray:
        """Return an accessor, shape (count, components).

        Integers that stand for shares of a whole become float32 (section 3.6.2.2), and what a sparse
        accessor replaces is replaced.
        """
        accessor = self._header["accessors"][number]
        kind, width = np.dtype(TYPES[accessor["componentType"]]), COMPONENTS[accessor["type"]]
        count = accessor["count"]
        values = np.zeros((count, width), kind)
        if "bufferView" in accessor:
            values = self._rows(accessor, kind, width, count)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            index_kind = np.dtype(TYPES[sparse["indices"]["componentType"]])
            rows = self._rows(sparse["indices"], index_kind, 1, sparse["count"])[:, 0]
            values = values.copy()
            values[rows] = self._rows(sparse["values"], kind, width, sparse["count"])
        if accessor.get("normalized") and kind.kind in "iu":
            top = np.iinfo(kind).max
            values = np.maximum(values.astype(np.float32) / np.float32(top), -1.0)
        return values

    def _rows(self, place: dict[str, Any], kind: np.dtype, width: int, count: int) -> np.ndarray:
        view = self._header["bufferViews"][place["bufferView"]]
        start = view.get("byteOffset", 0) + place.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * width)
        data = self._buffers[view["buffer"]]
        return np.ndarray((count, width), kind, data, start, (stride, kind.itemsize))

    @cached_property
    def _buffers(self) -> list[bytes]:
        return [
            uri_bytes(self._path, entry["uri"]) if "uri" in entry else glb_binary(self._path)
            for entry in self._header.get("buffers", [])
        ]
