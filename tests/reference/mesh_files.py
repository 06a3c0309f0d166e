"""Small meshes, files of them, and what every loaded scene promises."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image
from scipy.spatial import ConvexHull
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from digs_warp.data.images import write_image
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.scene.scene import Scene
from reference.gltf_builder import glb_bytes

# The simplest mesh with an inside, without a material; an OBJ file, too.
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"

# A textured square in the plane z = 0.
OBJ = (
    "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl paint\nf 1/1 2/2 3/3\n"
)


def under_gray_sky(folder: Path, mesh: str, **settings: Any) -> SimulateConfig:
    """Write an OBJ file and a gray panorama; return settings that record one frame of them."""
    path, sky = folder / "thing.obj", folder / "sky.png"
    path.write_text(mesh)
    write_image(sky, np.full((8, 16, 3), 200, np.uint8))
    return SimulateConfig(
        profile="bare-matcher",
        mesh=path,
        environment=sky,
        frames=1,
        samples_per_pixel=1,
        **settings,
    )


def check_arrays(scene: Scene) -> None:
    """Shapes, number types, and finite values."""
    n, m = len(scene.vertices), len(scene.faces)
    for array, shape, dtype in (
        (scene.vertices, (n, 3), np.float32),
        (scene.faces, (m, 3), np.int32),
        (scene.face_materials, (m,), np.int32),
        (scene.normals, (n, 3), np.float32),
        (scene.uvs, (n, 2), np.float32),
        (scene.vertex_colors, (n, 3), np.float32),
    ):
        assert array.shape == shape
        assert array.dtype == dtype
        assert np.isfinite(array).all()


def check_scene(scene: Scene, size: float | None = None) -> None:
    """Everything that `Scene` promises; ``size`` is its longest side [m], if known."""
    n, m = len(scene.vertices), len(scene.faces)
    check_arrays(scene)
    assert m >= 1
    assert set(np.unique(scene.faces)) == set(range(n))
    assert scene.face_materials.min() >= 0
    assert scene.face_materials.max() < len(scene.materials)
    low, high = scene.vertices.min(axis=0), scene.vertices.max(axis=0)
    longest = (high - low).max()
    if size is not None:
        np.testing.assert_allclose(longest, size, rtol=1e-6)
    np.testing.assert_allclose(low + high, 0, atol=1e-6 * longest)
    np.testing.assert_allclose(np.linalg.norm(scene.normals, axis=1), 1, atol=1e-5)
    facing = face_vectors(scene)
    assert np.linalg.norm(facing, axis=1).min() > 0
    assert (np.einsum("ij,ij->i", facing, scene.normals[scene.faces].sum(axis=1)) >= 0).all()
    assert scene.vertex_colors.min() >= 0
    assert scene.vertex_colors.max() <= 1
    for material in scene.materials:
        assert 0 <= material.roughness <= 1
        assert 0 <= material.metallic <= 1
        assert material.base_color.shape == (3,)
        if material.texture is not None:
            assert material.texture.dtype == np.uint8
            assert material.texture.ndim == 3
            assert material.texture.shape[2] == 3


def assert_rests(scene: Scene) -> None:
    """Points less than 1 mm above the ground surround the center of mass of the convex hull."""
    vertices = scene.vertices.astype(np.float64)
    solid = trimesh.Trimesh(vertices, process=False).convex_hull
    touching = vertices[vertices[:, 2] < vertices[:, 2].min() + 1e-3]
    edges = ConvexHull(touching[:, :2]).equations
    assert (edges @ [*solid.center_mass[:2], 1.0]).max() < 1e-3


def face_vectors(scene: Scene) -> np.ndarray:
    """Normals as long as twice the area of each face."""
    a, b, c = np.moveaxis(scene.vertices[scene.faces].astype(np.float64), 1, 0)
    return np.cross(b - a, c - a)


def corners_of(scene: Scene) -> np.ndarray:
    """Corner positions face by face: the shape, however vertices are shared, (m, 3, 3)."""
    return scene.vertices[scene.faces]


def save(path: Path, mesh: Any) -> Path:
    """Write a mesh or scene with trimesh, in the format of the suffix."""
    data = mesh.export(file_type=path.suffix[1:])
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


def lopsided() -> trimesh.Trimesh:
    """A small smooth mesh without any symmetry."""
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    mesh.vertices = mesh.vertices * (1.0, 1.7, 0.6)
    mesh.vertices[:, 0] += 0.3 * mesh.vertices[:, 1] ** 2
    return mesh


def checker(size: int = 16) -> Image.Image:
    """Red on the top left, green on the top right, blue below."""
    pixels = np.zeros((size, size, 3), np.uint8)
    pixels[: size // 2, : size // 2] = (255, 0, 0)
    pixels[: size // 2, size // 2 :] = (0, 255, 0)
    pixels[size // 2 :] = (0, 0, 255)
    return Image.fromarray(pixels)


def textured_square(texture_share: float = 1.0, **material: Any) -> trimesh.Trimesh:
    """A unit square in the plane z = 0 that shows the lower left part of its texture, or all."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    pbr = PBRMaterial(name="paint", **material)
    visual = TextureVisuals(uv=vertices[:, :2] * texture_share, material=pbr)
    return trimesh.Trimesh(vertices, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)


def edit_gltf(path: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """Change the JSON header of a GLB file in place."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    header = json.loads(data[20 : 20 + length])
    change(header)
    (size,) = struct.unpack_from("<I", data, 20 + length)
    path.write_bytes(glb_bytes(json.dumps(header).encode(), data[28 + length : 28 + length + size]))
    return path
