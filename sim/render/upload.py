"""A `Scene` copied to the device, with the BVH of its faces."""

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.device.warp_start import start_warp
from digs_warp.sim.render.surface import MaterialData, Surface
from digs_warp.sim.render.textures import LINEAR, SRGB, TextureImage, pack_textures
from digs_warp.sim.scene.scene import Material, Scene

start_warp()

# Shares of the scene's radius: a ray that passes a surface continues this far behind it, and one that
# leaves a surface starts this far off it, so that it does not hit it again.
STEP_SHARE = 2e-5
LIFT_SHARE = 1e-4

# Shorter tangents have no direction: mirrored halves cancel out, or the texture has no extent.
MIN_TANGENT = 1e-12

TEXTURE_FIELDS = {
    "texture": SRGB,
    "finish_texture": LINEAR,
    "opacity_texture": LINEAR,
    "transmission_texture": LINEAR,
    "emission_texture": SRGB,
    "normal_texture": LINEAR,
}


@dataclass(frozen=True, eq=False)
class DeviceScene:
    """A scene on the device: the kernels' struct, and the BVH, which lives as long as this object."""

    surface: Surface
    mesh: wp.Mesh


def upload_scene(scene: Scene) -> DeviceScene:
    """Copy a scene to the device, without its openness."""
    mesh = wp.Mesh(
        wp.array(scene.vertices, dtype=wp.vec3, device="cpu"),
        wp.array(scene.faces.reshape(-1), dtype=int, device="cpu"),
        bvh_leaf_size=2,
    )
    slots, images = _texture_slots(scene.materials)
    surface = Surface()
    surface.mesh = mesh.id
    surface.points = mesh.points
    surface.corners = wp.array(scene.faces.reshape(-1), dtype=int, device="cpu")
    surface.normals = wp.array(scene.normals, dtype=wp.vec3, device="cpu")
    if any(material.normal_texture is not None for material in scene.materials):
        surface.tangents = wp.array(_vertex_tangents(scene), dtype=wp.vec3, device="cpu")
        surface.handedness = wp.array(_face_handedness(scene), dtype=float, device="cpu")
    surface.uvs = wp.array(scene.uvs, dtype=wp.vec2, device="cpu")
    surface.colors = wp.array(scene.vertex_colors, dtype=wp.vec3, device="cpu")
    surface.materials = wp.array(scene.face_materials, dtype=int, device="cpu")
    surface.objects = wp.array(scene.face_objects, dtype=int, device="cpu")
    surface.uv_levels = wp.array(_uv_levels(scene), dtype=float, device="cpu")
    data = [_material_data(m, slot) for m, slot in zip(scene.materials, slots, strict=True)]
    surface.data = wp.array(data, dtype=MaterialData, device="cpu")
    surface.textures = pack_textures(images)
    surface.see_through = int(any(is_see_through(material) for material in scene.materials))
    surface.step = STEP_SHARE * scene.radius
    surface.lift = LIFT_SHARE * scene.radius
    surface.radius = scene.radius
    return DeviceScene(surface, mesh)


def _texture_slots(
    materials: tuple[Material, ...],
) -> tuple[list[dict[str, int]], list[TextureImage]]:
    """Return the index of every texture of every material, and the textures without duplicates."""
    images: list[TextureImage] = []
    number_of: dict[int, int] = {}
    slots = []
    for material in materials:
        slot = dict.fromkeys(TEXTURE_FIELDS, -1)
        for field, table in TEXTURE_FIELDS.items():
            pixels = getattr(material, field)
            if pixels is None:
                continue
            if id(pixels) not in number_of:
                number_of[id(pixels)] = len(images)
                images.append(TextureImage(pixels, table))
            slot[field] = number_of[id(pixels)]
        slots.append(slot)
    return slots, images


def is_see_through(material: Material) -> bool:
    """Whether any part of the material may let light through."""
    return (
        material.opacity < 1
        or material.transmission > 0
        or material.opacity_texture is not None
        or material.transmission_texture is not None
    )


# What `Material` and `MaterialData` name alike.
NUMBERS = ("roughness", "metallic", "opacity", "alpha_cutoff", "transmission", "reflectance")
COLORS = ("base_color", "emission")


def _material_data(material: Material, textures: dict[str, int]) -> MaterialData:
    data = MaterialData()
    data.see_through = int(is_see_through(material))
    for name in NUMBERS:
        setattr(data, name, getattr(material, name))
    for name in COLORS:
        setattr(data, name, wp.vec3(*(float(value) for value in getattr(material, name))))
    for name, number in textures.items():
        setattr(data, name, number)
    return data


def _uv_levels(scene: Scene) -> np.ndarray:
    """Return log2 of the texture widths per metre of each face, shape (m,): the constant of the ray cones.

    Akenine-Moller et al. 2019, eq. 5: half the log2 of texture area over surface area.
    """
    (ab, ac), uv_area = _edges_and_uv_area(scene)
    area = np.linalg.norm(np.cross(ab, ac), axis=1)
    # Faces without area in the texture show one texel, at the finest level.
    return (0.5 * np.log2(np.maximum(np.abs(uv_area), 1e-18) / np.maximum(area, 1e-30))).astype(
        np.float32
    )


def _vertex_tangents(scene: Scene) -> np.ndarray:
    """Return the unit direction in which u grows at each vertex, (n, 3), float32; 0: none.

    The mean over the faces around a vertex, weighted by area, as programs that bake normal maps compute it.
    Vertices are already split along the seams of the texture.
    """
    along_u = _face_tangents(scene)
    total = np.zeros((len(scene.vertices), 3))
    for corner in range(3):
        np.add.at(total, scene.faces[:, corner], along_u)
    normals = scene.normals.astype(np.float64)
    total -= (total * normals).sum(axis=1, keepdims=True) * normals
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > MIN_TANGENT, total / np.maximum(length, MIN_TANGENT), 0.0).astype(
        np.float32
    )


def _face_handedness(scene: Scene) -> np.ndarray:
    """Return 1 where (u, v, normal) is right-handed and -1 where the texture is mirrored, (m,), float32."""
    edges, uv_area = _edges_and_uv_area(scene)
    outward = np.cross(edges[0], edges[1])
    along = (outward * scene.normals[scene.faces].sum(axis=1)).sum(axis=1)
    return np.where(uv_area * along < 0, -1.0, 1.0).astype(np.float32)


def _face_tangents(scene: Scene) -> np.ndarray:
    """Return dP/du of each face times its area in the world, shape (m, 3)."""
    (ab, ac), uv_area = _edges_and_uv_area(scene)
    a, b, c = np.moveaxis(scene.uvs[scene.faces].astype(np.float64), 1, 0)
    along_u = (c - a)[:, 1:] * ab - (b - a)[:, 1:] * ac
    along_u *= np.sign(uv_area)[:, None]
    length = np.maximum(np.linalg.norm(along_u, axis=1, keepdims=True), 1e-300)
    return along_u / length * np.linalg.norm(np.cross(ab, ac), axis=1, keepdims=True)


def _edges_and_uv_area(scene: Scene) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Return the two edges at the first corner, (m, 3) each, and twice the signed area in the texture."""
    a, b, c = np.moveaxis(scene.vertices[scene.faces].astype(np.float64), 1, 0)
    ua, ub, uc = np.moveaxis(scene.uvs[scene.faces].astype(np.float64), 1, 0)
    ab, ac = ub - ua, uc - ua
    return (b - a, c - a), ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
