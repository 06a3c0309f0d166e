"""The default renderer: rays through a Warp BVH, on all cores, without any graphics driver."""

# Warp's type hints take the dtype of an array for a value, and structs for functions.
# pyright: reportArgumentType=false, reportGeneralTypeIssues=false

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from digs_warp.camera import Camera
from digs_warp.checks import DigsError
from digs_warp.parallel import launch_parallel
from sim.environment import Environment
from sim.render.kernels import View, color_kernel, geometry_kernel, openness_kernel
from sim.render.lighting import prepare_light
from sim.render.shading import Surface
from sim.render.textures import pack_textures
from sim.scene import Scene

# Rays that measure how open a vertex lies, on each side; large meshes share out the budget.
OPENNESS_RAYS = 64
OPENNESS_BUDGET = 2_000_000
MIN_OPENNESS_RAYS = 8

# Occluders farther away than this share of the scene's radius do not darken a surface.
OPENNESS_REACH = 0.7

# Rays start this share of the scene's radius off the surface, so that they do not meet it again.
SURFACE_OFFSET = 1e-4


@dataclass(frozen=True, eq=False)
class RenderedView:
    """What one eye sees.

    Attributes:
        image: sRGB, shape (height, width, 3), uint8.
        mask: share of each pixel that the object covers, 0..255, shape (height, width), uint8.
        depth: planar z at the pixel centres [m], shape (height, width), float32; the surround has the
            depth of its sphere.
        normals_world: unit normals toward the viewer at the pixel centres, (height, width, 3), float32.
        material_ids: material at the pixel centres, (height, width), int32; -1: the surround.
    """

    image: np.ndarray
    mask: np.ndarray
    depth: np.ndarray
    normals_world: np.ndarray
    material_ids: np.ndarray


class RaycastRenderer:
    """A scene and its environment, ready to be seen from any camera inside the surround."""

    def __init__(self, scene: Scene, environment: Environment, threads: int = 0) -> None:
        self.threads = threads
        self.surround_radius = environment.radius
        self._panorama_height = environment.radiance.shape[0]
        self._light = prepare_light(environment, threads)
        self._mesh = wp.Mesh(
            wp.array(scene.vertices, dtype=wp.vec3, device="cpu"),
            wp.array(scene.faces.reshape(-1), dtype=int, device="cpu"),
        )
        self._surface = _upload(scene, self._mesh)
        self._surface.openness = self._measure_openness(scene)

    @property
    def exposure(self) -> float:
        """The factor from radiance to pixel value, the same for every view."""
        return self._light.exposure

    def render(self, camera: Camera, samples_per_pixel: int = 4, seed: int = 0) -> RenderedView:
        """Return image, mask, depth, normals and material ids of a view."""
        image, mask = self.render_image(camera, samples_per_pixel, seed)
        depth, normals, materials = self.render_geometry(camera)
        return RenderedView(image, mask, depth, normals, materials)

    def render_image(
        self, camera: Camera, samples_per_pixel: int = 4, seed: int = 0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the image, (height, width, 3), and the mask, (height, width), both uint8.

        The same (camera, samples_per_pixel, seed) gives the same bytes, whatever was rendered before.
        """
        if samples_per_pixel < 1:
            raise DigsError(f"samples_per_pixel: {samples_per_pixel}, expected at least 1")
        view = self._view(camera, samples_per_pixel)
        height, width = camera.intrinsics.height, camera.intrinsics.width
        image = wp.empty((height * width, 3), dtype=wp.uint8, device="cpu")
        mask = wp.empty(height * width, dtype=wp.uint8, device="cpu")
        scalars = [samples_per_pixel, _int32(seed)]
        inputs = [view, self._surface, self._light.struct, *scalars, image, mask]
        self._launch(color_kernel, height * width, inputs)
        return image.numpy().reshape(height, width, 3), mask.numpy().reshape(height, width)

    def render_geometry(self, camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return depth, world normals and material ids at the pixel centres; see `RenderedView`."""
        view = self._view(camera, 1)
        height, width = camera.intrinsics.height, camera.intrinsics.width
        depth = wp.empty(height * width, dtype=float, device="cpu")
        normals = wp.empty(height * width, dtype=wp.vec3, device="cpu")
        materials = wp.empty(height * width, dtype=int, device="cpu")
        inputs = [view, self._surface, depth, normals, materials]
        self._launch(geometry_kernel, height * width, inputs)
        return (
            depth.numpy().reshape(height, width),
            normals.numpy().reshape(height, width, 3),
            materials.numpy().reshape(height, width),
        )

    def _view(self, camera: Camera, samples_per_pixel: int) -> View:
        distance = float(np.linalg.norm(camera.center_world))
        if distance >= self.surround_radius:
            raise DigsError(
                f"camera: {distance:.3g} m from the origin, outside the surround of radius "
                f"{self.surround_radius:.3g} m; make the environment larger or come closer"
            )
        k = camera.intrinsics
        view = View()
        view.width = k.width
        view.fx, view.fy, view.cx, view.cy = k.fx, k.fy, k.cx, k.cy
        view.world_from_cam = wp.mat33(camera.world_from_cam[:3, :3].astype(np.float32))
        view.center = wp.vec3(*camera.center_world)
        view.surround_radius = self.surround_radius
        # The samples of a pixel share its area: each answers for a cone of 1 / sqrt(n) of its width.
        view.pixel_cone = 1.0 / (min(k.fx, k.fy) * np.sqrt(samples_per_pixel))
        texel_angle = np.pi / self._panorama_height
        view.surround_level = float(max(0.0, np.log2(view.pixel_cone / texel_angle)))
        return view

    def _measure_openness(self, scene: Scene) -> Any:
        count = len(scene.vertices)
        rays = int(np.clip(OPENNESS_BUDGET // (2 * count), MIN_OPENNESS_RAYS, OPENNESS_RAYS))
        openness = wp.empty(count, dtype=wp.vec2, device="cpu")
        scalars = [rays, OPENNESS_REACH * scene.radius, SURFACE_OFFSET * scene.radius]
        inputs = [self._mesh.id, self._mesh.points, self._surface.normals, *scalars, openness]
        self._launch(openness_kernel, count, inputs)
        return openness

    def _launch(self, kernel: Any, dim: int, inputs: list[Any]) -> None:
        launch_parallel(kernel, dim, inputs, threads=self.threads)


def _int32(seed: int) -> int:
    """Fold any non-negative seed into the range of a kernel's int."""
    return int(np.uint32(seed % 2**32).astype(np.int32))


def _upload(scene: Scene, mesh: wp.Mesh) -> Surface:
    """Copy a scene to the device; everything but the openness."""
    textured = [i for i, material in enumerate(scene.materials) if material.texture is not None]
    images = [material.texture for material in scene.materials if material.texture is not None]
    texture_of = np.full(len(scene.materials), -1, dtype=np.int32)
    texture_of[textured] = np.arange(len(textured))

    surface = Surface()
    surface.mesh = mesh.id
    surface.corners = wp.array(scene.faces.reshape(-1), dtype=int, device="cpu")
    surface.normals = wp.array(scene.normals, dtype=wp.vec3, device="cpu")
    surface.uvs = wp.array(scene.uvs, dtype=wp.vec2, device="cpu")
    surface.colors = wp.array(scene.vertex_colors, dtype=wp.vec3, device="cpu")
    surface.materials = wp.array(scene.face_materials, dtype=int, device="cpu")
    surface.texel_levels = wp.array(_texel_levels(scene), dtype=float, device="cpu")
    base_colors = np.array([material.base_color for material in scene.materials], np.float32)
    surface.base_colors = wp.array(base_colors, dtype=wp.vec3, device="cpu")
    roughness = np.array([material.roughness for material in scene.materials], np.float32)
    surface.roughness = wp.array(roughness, dtype=float, device="cpu")
    metallic = np.array([material.metallic for material in scene.materials], np.float32)
    surface.metallic = wp.array(metallic, dtype=float, device="cpu")
    surface.material_textures = wp.array(texture_of, dtype=int, device="cpu")
    surface.textures = pack_textures(images)
    return surface


def _texel_levels(scene: Scene) -> np.ndarray:
    """Return log2 of the texels per metre of each face, shape (m,): the constant of the ray cones.

    Akenine-Moller et al. 2019, eq. 5: half the log2 of texel area over surface area.
    """
    a, b, c = np.moveaxis(scene.vertices[scene.faces].astype(np.float64), 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    ua, ub, uc = np.moveaxis(scene.uvs[scene.faces].astype(np.float64), 1, 0)
    ab, ac = ub - ua, uc - ua
    uv_area = np.abs(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    texels = np.array(
        [
            1 if m.texture is None else m.texture.shape[0] * m.texture.shape[1]
            for m in scene.materials
        ]
    )[scene.face_materials]
    # Faces without extent in the texture show one texel: the finest level.
    return (0.5 * np.log2(np.maximum(texels * uv_area, 1e-12) / np.maximum(area, 1e-30))).astype(
        np.float32
    )
