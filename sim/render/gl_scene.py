"""A `Scene` and its surround as meshes of pyrender."""

from typing import Any

import numpy as np

from digs_warp.data.images import srgb_from_linear, to_uint8
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL, look_at
from digs_warp.geometry.sh import sh_basis
from digs_warp.sim.scene.environment import Environment, panorama_directions
from digs_warp.sim.scene.scene import FURNITURE, Material, Scene

# Segments of the surround's sphere: they distort its texture by less than a tenth of a degree.
SPHERE_COLUMNS, SPHERE_ROWS = 256, 128

# OpenGL only blends glass: this share of the glass color keeps it visible.
GLASS_ALPHA = 0.2


def material_meshes(pyrender: Any, scene: Scene) -> list[Any]:
    """Return a two-sided mesh for each material of each object, named "material object" by their numbers."""
    meshes = []
    of_faces = np.stack([scene.face_materials, scene.face_objects], axis=1)
    for number, thing in np.unique(of_faces, axis=0).tolist():
        material = scene.materials[number]
        chosen = scene.faces[(of_faces == (number, thing)).all(axis=1)]
        used, index = np.unique(chosen, return_inverse=True)
        index = index.reshape(-1, 3)
        white = (scene.vertex_colors[used] == 1).all()
        colors = None if white else np.tile(_with_alpha(scene.vertex_colors[used]), (2, 1))
        primitive = pyrender.Primitive(
            positions=np.tile(scene.vertices[used], (2, 1)),
            normals=np.concatenate([scene.normals[used], -scene.normals[used]]),
            texcoord_0=np.tile(scene.uvs[used], (2, 1)),
            color_0=colors,
            # OpenGL lights and draws front faces only: the back is a second surface.
            indices=np.concatenate([index, index[:, ::-1] + len(used)]),
            material=_material(pyrender, material),
        )
        meshes.append(pyrender.Mesh([primitive], name=f"{number} {thing}"))
    return meshes


def normal_mesh(pyrender: Any, scene: Scene) -> Any:
    """Return the scene with its normals as vertex colors, those of the back reversed."""
    normals = np.concatenate([scene.normals, -scene.normals])
    primitive = pyrender.Primitive(
        positions=np.tile(scene.vertices, (2, 1)),
        normals=normals,
        color_0=_with_alpha(0.5 + 0.5 * normals),
        indices=np.concatenate([scene.faces, scene.faces[:, ::-1] + len(scene.vertices)]),
        material=_white(pyrender),
    )
    return pyrender.Mesh([primitive])


def coverage_mesh(pyrender: Any, scene: Scene) -> Any:
    """Return the scene in white where it belongs to an object, in black where it is furniture."""
    corners = np.concatenate([scene.faces, scene.faces[:, ::-1]])
    is_object = np.tile(scene.face_objects != FURNITURE, 2)
    primitive = pyrender.Primitive(
        positions=scene.vertices[corners].reshape(-1, 3),
        color_0=_with_alpha(np.repeat(is_object, 3)[:, None] * np.ones(3)),
        material=_white(pyrender),
    )
    return pyrender.Mesh([primitive])


def sphere_mesh(pyrender: Any, environment: Environment, exposure: float) -> Any:
    """Return the surround: a sphere with the exposed panorama, clipped to eight bits."""
    u, v = np.meshgrid(
        np.linspace(0, 1, SPHERE_COLUMNS + 1), np.linspace(0, 1, SPHERE_ROWS + 1), indexing="xy"
    )
    azimuth, polar = (0.5 - u) * 2 * np.pi, v * np.pi
    positions = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1
    )
    columns = SPHERE_COLUMNS + 1
    corner = (np.arange(SPHERE_ROWS)[:, None] * columns + np.arange(SPHERE_COLUMNS)).reshape(-1)
    faces = np.concatenate(
        [
            np.stack([corner, corner + 1, corner + columns], axis=1),
            np.stack([corner + 1, corner + columns + 1, corner + columns], axis=1),
        ]
    )
    pixels = to_uint8(srgb_from_linear(np.clip(environment.radiance * exposure, 0, 1)))
    primitive = pyrender.Primitive(
        positions=environment.radius * positions.reshape(-1, 3),
        texcoord_0=np.stack([u, 1 - v], axis=-1).reshape(-1, 2),
        indices=faces,
        material=_white(pyrender, baseColorTexture=_texture(pyrender, pixels)),
    )
    return pyrender.Mesh([primitive])


def two_lights(pyrender: Any, scene: Any, irradiance: np.ndarray) -> None:
    """Light ``scene`` with the direction and the ambient level that fit the environment best.

    Args:
        pyrender: the module.
        scene: of pyrender.
        irradiance: spherical-harmonics coefficients of the diffuse light, shape (9, 3).
    """
    normals = panorama_directions(32, 16).reshape(-1, 3)
    light = sh_basis(normals, 2) @ irradiance
    direction = (light.mean(axis=1, keepdims=True) * normals).mean(axis=0)
    direction /= max(float(np.linalg.norm(direction)), 1e-9)
    lit = np.maximum(normals @ direction, 0.0)
    columns = np.stack([lit, np.ones_like(lit)], axis=1)
    key, ambient = np.maximum(np.linalg.lstsq(columns, light, rcond=None)[0], 0.0)
    scene.ambient_light = ambient
    strength = float(key.max())
    if strength > 0:
        lamp = pyrender.DirectionalLight(color=key / strength, intensity=np.pi * strength)
        aside = np.eye(3)[np.abs(direction).argmin()]
        scene.add(lamp, pose=look_at(direction, np.zeros(3), aside) @ OPENCV_FROM_OPENGL)


def _white(pyrender: Any, **maps: Any) -> Any:
    return pyrender.MetallicRoughnessMaterial(baseColorFactor=(1.0, 1.0, 1.0, 1.0), **maps)


def _with_alpha(colors: np.ndarray) -> np.ndarray:
    return np.concatenate([colors, np.ones((len(colors), 1))], axis=1).astype(np.float32)


def _material(pyrender: Any, material: Material) -> Any:
    alpha = material.opacity * (1.0 - material.transmission)
    alpha_texture = _alpha_texture(material)
    shown = pyrender.MetallicRoughnessMaterial(
        baseColorFactor=(
            *(float(value) for value in material.base_color),
            1.0 if alpha_texture is not None else max(alpha, GLASS_ALPHA),
        ),
        metallicFactor=material.metallic,
        roughnessFactor=material.roughness,
        emissiveFactor=material.emission,
        alphaMode="BLEND" if alpha_texture is not None or alpha < 1 else "OPAQUE",
    )
    if alpha_texture is not None:
        color = _resampled(material.texture, alpha_texture.shape)
        pixels = np.dstack([color, np.maximum(alpha_texture, np.uint8(255 * GLASS_ALPHA))])
        shown.baseColorTexture = pyrender.Texture(source=pixels, source_channels="RGBA")
    elif material.texture is not None:
        shown.baseColorTexture = _texture(pyrender, material.texture)
    if material.emission_texture is not None:
        shown.emissiveTexture = _texture(pyrender, material.emission_texture)
    return shown


def _alpha_texture(material: Material) -> np.ndarray | None:
    """Return each texel's alpha after opacity and transmission, (height, width), uint8; None: constant."""
    opaque, clear = material.opacity_texture, material.transmission_texture
    if opaque is None:
        if clear is None:
            return None
        opaque = np.full(clear.shape, 255.0 * material.opacity)
    passing = material.transmission if clear is None else _resampled(clear, opaque.shape) / 255.0
    return np.rint(opaque * (1.0 - passing)).astype(np.uint8)


def _resampled(pixels: np.ndarray | None, shape: tuple[int, ...]) -> np.ndarray:
    """Return a texture at another size, by nearest texels; white without a texture."""
    if pixels is None:
        return np.full((*shape, 3), 255, np.uint8)
    rows = np.arange(shape[0]) * pixels.shape[0] // shape[0]
    columns = np.arange(shape[1]) * pixels.shape[1] // shape[1]
    return pixels[rows[:, None], columns]


def _texture(pyrender: Any, pixels: np.ndarray) -> Any:
    return pyrender.Texture(source=pixels, source_channels="RGB")
