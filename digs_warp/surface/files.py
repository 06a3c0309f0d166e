"""Colored meshes as files: GLB (glTF 2.0) and PLY."""

import json
import struct
from pathlib import Path

import numpy as np

from digs_warp import __version__
from digs_warp.checks import DigsError
from digs_warp.data.images import linear_from_srgb, to_uint8
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.record.files import write_atomically

SUFFIXES = (".glb", ".ply")

# glTF is Y-up: (x, y, z) -> (x, z, -y).
GLTF_FROM_WORLD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])

# Numbers of the glTF 2.0 specification.
_FLOAT, _UNSIGNED_SHORT, _UNSIGNED_INT = 5126, 5123, 5125
_VERTEX_BUFFER, _INDEX_BUFFER = 34962, 34963


def write_mesh(path: Path, mesh: TriangleMesh) -> None:
    """Write a ``.glb`` (Y up, linear colors in 16 bits) or a ``.ply`` (our axes, sRGB in 8 bits).

    Raises:
        DigsError: another suffix, or a mesh without triangles.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise DigsError(f"mesh '{path}': suffix '{path.suffix}', expected {' or '.join(SUFFIXES)}")
    if not len(mesh):
        raise DigsError(f"mesh '{path}': there are 0 triangles to write")
    write_atomically(path, _glb(mesh) if suffix == ".glb" else _ply(mesh))


def vertex_normals(mesh: TriangleMesh) -> np.ndarray:
    """Return unit normals at the vertices, weighted by area, outwards, shape (n, 3), float32."""
    corners = mesh.points_world[mesh.triangles].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros((len(mesh.points_world), 3))
    for corner in range(3):
        np.add.at(sums, mesh.triangles[:, corner], normals)
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    up = (0.0, 0.0, 1.0)  # vertices of triangles without area
    return np.where(lengths > 0, sums / np.where(lengths > 0, lengths, 1.0), up).astype(np.float32)


def _ply(mesh: TriangleMesh) -> bytes:
    import trimesh

    colored = trimesh.Trimesh(
        mesh.points_world, mesh.triangles, vertex_colors=to_uint8(mesh.colors), process=False
    )
    data = colored.export(file_type="ply")
    assert isinstance(data, bytes)
    return data


def _glb(mesh: TriangleMesh) -> bytes:
    """Return a GLB file. trimesh would write 8-bit colors, of which linear ones leave dark tones few."""
    points = (mesh.points_world @ GLTF_FROM_WORLD.T).astype("<f4")
    linear = np.ones((len(points), 4))  # glTF vertex colors are linear
    linear[:, :3] = linear_from_srgb(mesh.colors)
    buffers = [
        (points, _FLOAT, "VEC3", _VERTEX_BUFFER),
        ((vertex_normals(mesh) @ GLTF_FROM_WORLD.T).astype("<f4"), _FLOAT, "VEC3", _VERTEX_BUFFER),
        (np.rint(65535 * linear).astype("<u2"), _UNSIGNED_SHORT, "VEC4", _VERTEX_BUFFER),
        (mesh.triangles.ravel().astype("<u4"), _UNSIGNED_INT, "SCALAR", _INDEX_BUFFER),
    ]
    views, accessors, start = [], [], 0
    for number, (values, kind, shape, target) in enumerate(buffers):
        views.append(
            {"buffer": 0, "byteOffset": start, "byteLength": values.nbytes, "target": target}
        )
        accessor = {
            "bufferView": number,
            "componentType": kind,
            "count": len(values),
            "type": shape,
        }
        accessors.append(accessor | ({"normalized": True} if kind == _UNSIGNED_SHORT else {}))
        start += values.nbytes  # all of them are multiples of 4 bytes, as glTF wants
    accessors[0] |= {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    attributes = {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2}
    document = {
        "asset": {"version": "2.0", "generator": f"digs-warp {__version__}"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "surface"}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 3, "material": 0}]}],
        # The colors hold the light of the scene already: fully rough, no metal.
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0}}],
        "buffers": [{"byteLength": start}],
        "bufferViews": views,
        "accessors": accessors,
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    data = b"".join(values.tobytes() for values, *_ in buffers)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
