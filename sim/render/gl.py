"""The OpenGL renderer (pyrender on EGL): an independent check of the ray caster, and an alternative.

Depth, masks, normals and material ids mean the same as the ray caster's. Colors are simpler: one light and
an ambient level replace the environment, there are no shadows, glass is opaque, and each pixel always has
four samples. Rays for the sensor's effects use the ray caster's BVH.
"""

from functools import cache
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.images import srgb_from_linear, to_uint8
from digs_warp.device.libraries import PYRENDER_APT, MissingLibraryError, import_pyrender
from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL, look_at
from digs_warp.geometry.sh import sh_basis
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.render.view import check_inside
from digs_warp.sim.render.views import CameraTrack, Geometry, Photograph
from digs_warp.sim.scene.environment import Environment, panorama_directions
from digs_warp.sim.scene.scene import FURNITURE, Material, Scene
from digs_warp.sim.sensor.color.encoding import decode, encode

# The near plane is at least this share of the scene's radius away: depth has only 24 bits.
NEAREST_SHARE = 2e-3

# Background of the image of normals: no direction, so that blended edges keep theirs.
NO_NORMAL = (0.5, 0.5, 0.5, 0.0)

# Margin between the clipping planes and the scene, as a share of its radius.
CLIP_MARGIN = 0.01


class GlRenderer(RaycastRenderer):
    """A scene and its environment, drawn by OpenGL.

    Args:
        scene: to draw; cut-out and transparent materials are solid surfaces.
        environment: the surround; its light is reduced to one direction and an ambient level.
        threads: for the rays of the sensor's effects; 0: all cores.

    Raises:
        MissingLibraryError: there is no EGL on this machine; the message names the packages.
    """

    def __init__(self, scene: Scene, environment: Environment, threads: int = 0) -> None:
        check_opengl()
        if environment.floor is not None:
            raise DigsError(
                "renderer 'gl': draws no ground; choose --ground none or the renderer raycast"
            )
        super().__init__(scene, environment, threads)
        self._pyrender = import_pyrender()
        self._radius = scene.radius
        self._drawing = self._pyrender.Scene(bg_color=np.zeros(4))
        self._shown = [self._drawing.add(m) for m in material_meshes(self._pyrender, scene)]
        self._normals = [self._drawing.add(normal_mesh(self._pyrender, scene))]
        self._covers = [self._drawing.add(coverage_mesh(self._pyrender, scene))]
        self._sky = to_uint8(srgb_from_linear(np.clip(environment.radiance * self.exposure, 0, 1)))
        two_lights(self._pyrender, self._drawing, self._light.irradiance.numpy())
        # Numbers of the meshes as colors; 0 is the background.
        self._id_colors = {
            node: (n & 255, (n >> 8) & 255, n >> 16) for n, node in enumerate(self._shown, 1)
        }
        kinds = [tuple(map(int, node.mesh.name.split())) for node in self._shown]
        self._kinds = np.array([(-1, 0), *kinds], np.int32)  # material and object of each number

    def render_image(
        self, camera: Camera, samples_per_pixel: int = 4, seed: int = 0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the image, (height, width, 3), and the mask, (height, width), both uint8."""
        flags = self._pyrender.RenderFlags
        mask, _ = self._draw(self._covers, camera, flags.FLAT)
        shown, _ = self._draw(self._shown, camera, flags.RGBA)
        through = 1.0 - shown[..., 3:] / 255.0
        image = shown[..., :3] + through * self._surround_colors(camera)
        return np.clip(image + 0.5, 0, 255).astype(np.uint8), mask[..., 0].copy()

    def photograph(self, track: CameraTrack, samples: int, seed: int = 0) -> Photograph:
        """Return the same; OpenGL draws eight bits, so nothing is known of the light above white."""
        return Photograph(*exposure_by_views(self, track, samples, seed), None)

    def render_geometry(self, camera: Camera) -> Geometry:
        """Return what is at the pixel centers.

        Normals have eight bits: they are off by about half a degree.
        """
        flags = self._pyrender.RenderFlags
        ids, depth = self._draw(self._shown, camera, flags.SEG)
        drawn = ids.astype(np.int32) @ np.array([1, 256, 65536], np.int32)
        materials, objects = np.moveaxis(self._kinds[drawn], -1, 0)
        is_hit = drawn > 0
        rays, far = self._surround_depth(camera)
        flat, _ = self._draw(self._normals, camera, flags.FLAT, background=NO_NORMAL)
        normals = flat / 127.5 - 1.0
        inward = -(camera.center_world + rays * far[..., None])
        normals = np.where(is_hit[..., None], normals, inward)
        normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
        depth = np.where(is_hit, depth, far)
        return Geometry(depth.astype(np.float32), normals.astype(np.float32), materials, objects)

    def _draw(
        self,
        nodes: list[Any],
        camera: Camera,
        flags: int,
        background: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
    ) -> tuple[np.ndarray, np.ndarray]:
        """Draw some of the meshes; return colors, uint8, and planar depth [m], 0 where there is nothing.

        All meshes stay in one scene: pyrender uploads a mesh again each time it is added.
        """
        check_inside(camera.center_world, self.surround)
        for node in self._drawing.mesh_nodes:
            node.mesh.is_visible = node in nodes
        self._drawing.bg_color = background
        k = camera.intrinsics
        canvas = _canvas()
        canvas.viewport_width, canvas.viewport_height = k.width, k.height
        near, far = self._clip_planes(camera)
        eye = self._pyrender.IntrinsicsCamera(k.fx, k.fy, k.cx, k.cy, znear=near, zfar=far)
        eye_node = self._drawing.add(eye, pose=camera.world_from_cam @ OPENCV_FROM_OPENGL)
        try:
            return canvas.render(self._drawing, flags, self._id_colors)
        finally:
            self._drawing.remove_node(eye_node)

    def _clip_planes(self, camera: Camera) -> tuple[float, float]:
        """Return the clipping depths [m], as tight around the scene as possible."""
        depth = float(camera.cam_from_world[2, 3])  # of the origin
        reach = (1.0 + CLIP_MARGIN) * self._radius
        near = max(depth - reach, NEAREST_SHARE * self._radius)
        return near, max(depth + reach, 2.0 * near)

    def _surround_colors(self, camera: Camera) -> np.ndarray:
        """Return what the surround shows at the pixel centers, sRGB, (height, width, 3), uint8."""
        import cv2

        rays, far = self._surround_depth(camera)
        x, y, z = np.moveaxis(
            (camera.center_world + rays * far[..., None]) / self.surround.radius, -1, 0
        )
        height, width = self._sky.shape[:2]
        u = (0.5 - np.arctan2(y, x) / (2 * np.pi)) * width - 0.5
        v = np.arccos(np.clip(z, -1, 1)) / np.pi * height - 0.5
        places = u.astype(np.float32), v.astype(np.float32)
        return cv2.remap(self._sky, *places, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)

    def _surround_depth(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """Return rays with z_cam = 1, (height, width, 3), and the planar depth of the surround [m]."""
        k = camera.intrinsics
        px = pixel_centers(k.width, k.height)
        eye = camera.center_world
        rays = camera.unproject(px, np.ones(px.shape[:2])) - eye
        a, b = (rays**2).sum(axis=-1), rays @ eye
        return rays, (-b + np.sqrt(b * b + a * (self.surround.radius**2 - eye @ eye))) / a


def check_opengl() -> None:
    """Raise a `MissingLibraryError` if OpenGL cannot draw off-screen; the message names the packages."""
    _canvas()


@cache
def _canvas() -> Any:
    """Return the off-screen buffer of the process: pyrender shuts down EGL when it frees the first one."""
    try:
        return import_pyrender().OffscreenRenderer(1, 1)
    except MissingLibraryError:
        raise
    except Exception as error:  # PyOpenGL raises its own, ctypes' and plain AttributeErrors
        raise MissingLibraryError(
            f"OpenGL cannot draw off-screen here ({type(error).__name__}: {error}); install EGL and "
            f"its drivers: {PYRENDER_APT}; or use the ray caster"
        ) from error


def exposure_by_views(
    renderer: RaycastRenderer, track: CameraTrack, samples: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return image and mask of `RaycastRenderer.photograph` as the mean of many views."""
    seeds = np.random.SeedSequence(seed).generate_state(track.world_from_cam[..., 0, 0].size)
    numbers = iter(seeds.tolist())
    bands = [
        _mean([renderer.render_image(camera, samples, next(numbers)) for camera in cameras])
        for cameras in track.bands()
    ]
    images, masks = zip(*bands, strict=True)
    return np.concatenate(images), np.concatenate(masks)


def _mean(views: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean image (in linear light) and the mean mask of several views, uint8."""
    if len(views) == 1:
        return views[0]
    images, masks = zip(*views, strict=True)
    light = sum(map(decode, images[1:]), decode(images[0])) / len(views)
    cover = np.stack(masks).sum(axis=0, dtype=np.float32)
    return encode(light), (cover / len(views) + 0.5).astype(np.uint8)


def material_meshes(pyrender: Any, scene: Scene) -> list[Any]:
    """Return a two-sided mesh for each material of each object, named "material object" by their numbers."""
    meshes = []
    of_faces = np.stack([scene.face_materials, scene.face_objects], axis=1)
    for number, thing in np.unique(of_faces, axis=0).tolist():
        chosen = scene.faces[(of_faces == (number, thing)).all(axis=1)]
        used, index = np.unique(chosen, return_inverse=True)
        index = index.reshape(-1, 3)
        primitive = pyrender.Primitive(
            positions=np.tile(scene.vertices[used], (2, 1)),
            normals=np.concatenate([scene.normals[used], -scene.normals[used]]),
            texcoord_0=np.tile(scene.uvs[used], (2, 1)),
            color_0=np.tile(_with_alpha(scene.vertex_colors[used]), (2, 1)),
            # OpenGL lights and draws front faces only: the back is a second surface.
            indices=np.concatenate([index, index[:, ::-1] + len(used)]),
            material=_material(pyrender, scene.materials[number]),
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
        material=pyrender.MetallicRoughnessMaterial(baseColorFactor=(1.0, 1.0, 1.0, 1.0)),
    )
    return pyrender.Mesh([primitive])


def coverage_mesh(pyrender: Any, scene: Scene) -> Any:
    """Return the scene in white where it belongs to an object, in black where it is furniture."""
    corners = np.concatenate([scene.faces, scene.faces[:, ::-1]])
    is_object = np.tile(scene.face_objects != FURNITURE, 2)
    primitive = pyrender.Primitive(
        positions=scene.vertices[corners].reshape(-1, 3),
        color_0=_with_alpha(np.repeat(is_object, 3)[:, None] * np.ones(3)),
        material=pyrender.MetallicRoughnessMaterial(baseColorFactor=(1.0, 1.0, 1.0, 1.0)),
    )
    return pyrender.Mesh([primitive])


def two_lights(pyrender: Any, scene: Any, irradiance: np.ndarray) -> None:
    """Light a scene of pyrender with the direction and the ambient level that fit the environment best.

    ``irradiance``: spherical-harmonics coefficients of the diffuse light, shape (9, 3).
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


def _with_alpha(colors: np.ndarray) -> np.ndarray:
    return np.concatenate([colors, np.ones((len(colors), 1))], axis=1).astype(np.float32)


def _material(pyrender: Any, material: Material) -> Any:
    maps = {"baseColorTexture": material.texture, "emissiveTexture": material.emission_texture}
    return pyrender.MetallicRoughnessMaterial(
        baseColorFactor=(*material.base_color.tolist(), 1.0),
        metallicFactor=material.metallic,
        roughnessFactor=material.roughness,
        emissiveFactor=material.emission,
        **{
            name: pyrender.Texture(source=pixels, source_channels="RGB")
            for name, pixels in maps.items()
            if pixels is not None
        },
    )
