"""Colored meshes as files: GLB (glTF 2.0) and PLY."""

from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.glb import glb_file
from digs_warp.data.images import linear_from_srgb, to_uint8
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.record.files import write_atomically

SUFFIXES = (".glb", ".ply")

# glTF is Y-up: (x, y, z) -> (x, z, -y).
GLTF_FROM_WORLD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


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
    attributes = {
        "POSITION": points,
        "NORMAL": (mesh.normals() @ GLTF_FROM_WORLD.T).astype("<f4"),
        "COLOR_0": np.rint(65535 * linear).astype("<u2"),
    }
    # The colors hold the light of the scene already: fully rough, no metal.
    material = {"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0}}
    indices = mesh.triangles.ravel().astype("<u4")
    return glb_file("surface", attributes, indices, {"material": 0}, {"materials": [material]})
