"""The scene's triangles and materials on the device, and what they hold at a ray's hit."""

# Kernel code is a language of its own; these checks misread it.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportReturnType=false

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.warp_start import start_warp
from sim.render.textures import (
    LINEAR,
    SRGB,
    TextureImage,
    TextureSet,
    pack_textures,
    sample_texture,
)
from sim.scene import OPAQUE_SHARE, Material, Scene

wp.set_module_options({"enable_backward": False})
start_warp()

# A ray cone at a grazing angle would stretch without bound.
MIN_COSINE = wp.constant(0.1)

# What counts as met by `trace`.
ANY_SURFACE = wp.constant(0.0)
OPAQUE = wp.constant(OPAQUE_SHARE)

# Shares of the scene's radius: a ray that passed a surface goes on this far behind it, and one that leaves
# a surface starts this far off it, so that it does not meet it again.
STEP_SHARE = 2e-5
LIFT_SHARE = 1e-4

# Walls that a ray passes before it is given up; a bottle with water in it has eight.
MAX_LAYERS = wp.constant(16)


@wp.struct
class MaterialData:
    """`sim.scene.Material` for kernels; a texture of -1 is none."""

    base_color: wp.vec3
    emission: wp.vec3
    roughness: float
    metallic: float
    opacity: float
    alpha_cutoff: float
    transmission: float
    color_texture: int
    finish_texture: int
    opacity_texture: int
    transmission_texture: int
    emission_texture: int
    normal_texture: int


@wp.struct
class Surface:
    """Triangles and materials; arrays in the order of `sim.scene.Scene`."""

    mesh: wp.uint64  # wp.Mesh
    corners: wp.array[int]  # [3 m] vertex of each corner
    normals: wp.array[wp.vec3]  # [n]
    tangents: wp.array[wp.vec3]  # [n] along u; length 0: no direction; empty without normal maps
    handedness: wp.array[float]  # [m] 1, or -1 where the texture is mirrored; empty as above
    uvs: wp.array[wp.vec2]  # [n]
    colors: wp.array[wp.vec3]  # [n]
    openness: wp.array[wp.vec2]  # [n] unoccluded share in front of and behind the normal
    materials: wp.array[int]  # [m]
    uv_levels: wp.array[float]  # [m] log2(texture widths per metre)
    data: wp.array[MaterialData]  # [materials]
    textures: TextureSet
    see_through: int  # 1: some material transmits or has an opacity below 1
    step: float  # [m] rays go on this far behind a surface that they pass
    lift: float  # [m] rays that leave a surface start this far off it


@wp.func
def vertex_normal(surface: Surface, hit: wp.MeshQueryRay) -> wp.vec3:
    """Unit normal interpolated between the corners; may point to either side."""
    corner = 3 * hit.face
    w = 1.0 - hit.u - hit.v
    normal = (
        hit.u * surface.normals[surface.corners[corner]]
        + hit.v * surface.normals[surface.corners[corner + 1]]
        + w * surface.normals[surface.corners[corner + 2]]
    )
    length = wp.length(normal)
    # Opposite vertex normals may cancel out; the triangle's own is always there.
    return wp.where(length > 1.0e-6, normal / wp.max(length, 1.0e-6), hit.normal)


@wp.func
def viewer_side(hit: wp.MeshQueryRay, direction: wp.vec3, normal: wp.vec3) -> float:
    """1 where ``normal`` points to the side of the triangle that the viewer is on, else -1.

    Surfaces have two sides, and meshes come with windings that disagree with their normals.
    """
    return wp.where(wp.dot(hit.normal, direction) * wp.dot(hit.normal, normal) > 0.0, -1.0, 1.0)


@wp.func
def viewer_side_normal(surface: Surface, hit: wp.MeshQueryRay, direction: wp.vec3) -> wp.vec3:
    """Interpolated unit normal, turned toward the viewer."""
    normal = vertex_normal(surface, hit)
    return viewer_side(hit, direction, normal) * normal


@wp.func
def texture_position(surface: Surface, hit: wp.MeshQueryRay) -> wp.vec2:
    """Texture coordinates of the hit."""
    corner = 3 * hit.face
    w = 1.0 - hit.u - hit.v
    return (
        hit.u * surface.uvs[surface.corners[corner]]
        + hit.v * surface.uvs[surface.corners[corner + 1]]
        + w * surface.uvs[surface.corners[corner + 2]]
    )


@wp.func
def texture_level(
    surface: Surface, hit: wp.MeshQueryRay, direction: wp.vec3, cone_width: float
) -> float:
    """log2 of the share of a texture's width that the ray's cone covers; see `sample_texture`."""
    cosine = wp.max(wp.abs(wp.dot(hit.normal, direction)), MIN_COSINE)
    return surface.uv_levels[hit.face] + wp.log2(wp.max(cone_width, 1.0e-12) / cosine)


@wp.func
def opacity_at(surface: Surface, hit: wp.MeshQueryRay, level: float) -> float:
    """Opacity of the hit, 0 where the material is cut out."""
    data = surface.data[surface.materials[hit.face]]
    opacity = data.opacity
    if data.opacity_texture >= 0:
        uv = texture_position(surface, hit)
        opacity = sample_texture(surface.textures, data.opacity_texture, uv, level, LINEAR)[0]
    return wp.where(opacity < data.alpha_cutoff, 0.0, opacity)


@wp.func
def transmission_at(surface: Surface, hit: wp.MeshQueryRay, level: float) -> float:
    """Share of the light that passes through the body of the surface at the hit."""
    data = surface.data[surface.materials[hit.face]]
    transmission = data.transmission
    if data.transmission_texture >= 0:
        uv = texture_position(surface, hit)
        transmission = sample_texture(
            surface.textures, data.transmission_texture, uv, level, LINEAR
        )[0]
    return transmission


@wp.func
def trace(
    surface: Surface, origin: wp.vec3, direction: wp.vec3, reach: float, cone: float, least: float
) -> float:
    """Distance along the ray to the first surface that hides at least ``least``; -1: none in reach.

    Holes that an opacity texture cuts are passed with any ``least``. ``cone`` is the spread of the ray
    [rad] for the lookup of textures.
    """
    start = wp.float32(0.0)
    found = wp.float32(-1.0)
    for _layer in range(MAX_LAYERS):
        hit = wp.mesh_query_ray(surface.mesh, origin + start * direction, direction, reach - start)
        if not hit.result:
            break
        distance = start + hit.t
        if surface.see_through == 0:
            found = distance
            break
        level = texture_level(surface, hit, direction, distance * cone)
        opacity = opacity_at(surface, hit, level)
        covered = opacity
        if least > 0.0:
            covered = opacity * (1.0 - transmission_at(surface, hit, level))
        if opacity > 0.0 and covered >= least:
            found = distance
            break
        start = distance + surface.step
        if start >= reach:
            break
    return found


@dataclass(frozen=True, eq=False)
class DeviceScene:
    """A scene on the device: what kernels get, and the BVH, which lives as long as this object."""

    surface: Surface
    mesh: wp.Mesh


def upload_scene(scene: Scene) -> DeviceScene:
    """Copy a scene to the device; everything but the openness."""
    mesh = wp.Mesh(
        wp.array(scene.vertices, dtype=wp.vec3, device="cpu"),
        wp.array(scene.faces.reshape(-1), dtype=int, device="cpu"),
    )
    slots, images = _texture_slots(scene.materials)
    surface = Surface()
    surface.mesh = mesh.id
    surface.corners = wp.array(scene.faces.reshape(-1), dtype=int, device="cpu")
    surface.normals = wp.array(scene.normals, dtype=wp.vec3, device="cpu")
    surface.uvs = wp.array(scene.uvs, dtype=wp.vec2, device="cpu")
    surface.colors = wp.array(scene.vertex_colors, dtype=wp.vec3, device="cpu")
    surface.materials = wp.array(scene.face_materials, dtype=int, device="cpu")
    surface.uv_levels = wp.array(_uv_levels(scene), dtype=float, device="cpu")
    data = [_material_data(m, slot) for m, slot in zip(scene.materials, slots, strict=True)]
    surface.data = wp.array(data, dtype=MaterialData, device="cpu")
    surface.textures = pack_textures(images)
    surface.see_through = int(any(_is_see_through(material) for material in scene.materials))
    surface.step = STEP_SHARE * scene.radius
    surface.lift = LIFT_SHARE * scene.radius
    return DeviceScene(surface, mesh)


TEXTURE_FIELDS = {
    "texture": SRGB,
    "finish_texture": LINEAR,
    "opacity_texture": LINEAR,
    "transmission_texture": LINEAR,
    "emission_texture": SRGB,
    "normal_texture": LINEAR,
}


def _texture_slots(
    materials: tuple[Material, ...],
) -> tuple[list[dict[str, int]], list[TextureImage]]:
    """Return the number of every texture of every material, and the textures, each once."""
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


def _is_see_through(material: Material) -> bool:
    return (
        material.opacity < 1
        or material.transmission > 0
        or material.opacity_texture is not None
        or material.transmission_texture is not None
    )


def _material_data(material: Material, slot: dict[str, int]) -> MaterialData:
    data = MaterialData()
    data.base_color = wp.vec3(*(float(value) for value in material.base_color))
    data.emission = wp.vec3(*material.emission)
    data.roughness = material.roughness
    data.metallic = material.metallic
    data.opacity = material.opacity
    data.alpha_cutoff = material.alpha_cutoff
    data.transmission = material.transmission
    data.color_texture = slot["texture"]
    data.finish_texture = slot["finish_texture"]
    data.opacity_texture = slot["opacity_texture"]
    data.transmission_texture = slot["transmission_texture"]
    data.emission_texture = slot["emission_texture"]
    data.normal_texture = slot["normal_texture"]
    return data


def _uv_levels(scene: Scene) -> np.ndarray:
    """Return log2 of the texture widths per metre of each face, shape (m,): the constant of the ray cones.

    Akenine-Moller et al. 2019, eq. 5: half the log2 of texture area over surface area.
    """
    a, b, c = np.moveaxis(scene.vertices[scene.faces].astype(np.float64), 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    ua, ub, uc = np.moveaxis(scene.uvs[scene.faces].astype(np.float64), 1, 0)
    ab, ac = ub - ua, uc - ua
    uv_area = np.abs(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    # Faces without extent in the texture show one texel: the finest level.
    return (0.5 * np.log2(np.maximum(uv_area, 1e-18) / np.maximum(area, 1e-30))).astype(np.float32)
