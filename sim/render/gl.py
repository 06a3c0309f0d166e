"""The OpenGL renderer (pyrender on EGL): an independent check of the ray caster's geometry.

OpenGL draws the triangles for depth, normals and the numbers of materials and objects. Photographs, the
surround and the rays for the sensor's effects are those of the ray caster.
"""

from functools import cache
from typing import Any

import numpy as np

from digs_warp.device.libraries import PYRENDER_APT, MissingLibraryError, import_pyrender
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.render.views import Geometry
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import Scene

# The near plane is at least this share of the scene's radius away: depth has only 24 bits.
NEAREST_SHARE = 2e-3

# Background of the image of normals: no direction, so that blended edges keep theirs.
NO_NORMAL = (0.5, 0.5, 0.5, 0.0)

# Margin between the clipping planes and the scene, as a share of its radius.
CLIP_MARGIN = 0.01


class GlRenderer(RaycastRenderer):
    """A scene whose geometry is drawn by OpenGL; cut-out materials are solid surfaces.

    Raises:
        MissingLibraryError: there is no EGL on this machine; the message names the packages.
    """

    def __init__(self, scene: Scene, environment: Environment, threads: int = 0) -> None:
        check_opengl()
        super().__init__(scene, environment, threads)
        self._pyrender = import_pyrender()
        self._radius = scene.radius
        self._drawing = self._pyrender.Scene(bg_color=NO_NORMAL)
        # By the numbers of material and object, as colors; 0 is the background.
        kinds, of_faces = np.unique(
            np.stack([scene.face_materials, scene.face_objects], axis=1),
            axis=0,
            return_inverse=True,
        )
        self._kinds = np.concatenate([[(-1, 0)], kinds]).astype(np.int32)
        self._id_colors = {}
        for n in range(len(kinds)):
            node = self._drawing.add(two_sided_mesh(self._pyrender, scene, of_faces == n))
            self._id_colors[node] = ((n + 1) & 255, (n + 1) >> 8, 0)

    def render_geometry(self, camera: Camera) -> Geometry:
        """Return what is at the pixel centers.

        Normals have eight bits: they are off by about half a degree.
        """
        flags = self._pyrender.RenderFlags
        ids, depth = self._draw(camera, flags.SEG)
        drawn = ids.astype(np.int32) @ np.array([1, 256, 65536], np.int32)
        materials, objects = np.moveaxis(self._kinds[drawn], -1, 0)
        normals = self._draw(camera, flags.FLAT)[0] / 127.5 - 1.0
        normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
        behind = super().render_geometry(camera)
        is_hit = drawn > 0
        return Geometry(
            np.where(is_hit, depth, behind.depth),
            np.where(is_hit[..., None], normals, behind.normals_world).astype(np.float32),
            materials,
            objects,
        )

    def _draw(self, camera: Camera, flags: int) -> tuple[np.ndarray, np.ndarray]:
        """Return colors, uint8, and planar depth [m], float32, 0 where there is nothing."""
        k = camera.intrinsics
        canvas = _canvas()
        canvas.viewport_width, canvas.viewport_height = k.width, k.height
        depth = float(camera.cam_from_world[2, 3])  # of the origin
        reach = (1.0 + CLIP_MARGIN) * self._radius
        near = max(depth - reach, NEAREST_SHARE * self._radius)
        far = max(depth + reach, 2.0 * near)
        eye = self._pyrender.IntrinsicsCamera(k.fx, k.fy, k.cx, k.cy, znear=near, zfar=far)
        eye_node = self._drawing.add(eye, pose=camera.world_from_cam @ OPENCV_FROM_OPENGL)
        try:
            return canvas.render(self._drawing, flags, self._id_colors)
        finally:
            self._drawing.remove_node(eye_node)


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


def two_sided_mesh(pyrender: Any, scene: Scene, which: np.ndarray) -> Any:
    """Return some faces, (m,), bool, with their normals as vertex colors, those of the back reversed."""
    used, index = np.unique(scene.faces[which], return_inverse=True)
    index = index.reshape(-1, 3)
    normals = np.concatenate([scene.normals[used], -scene.normals[used]])
    primitive = pyrender.Primitive(
        positions=np.tile(scene.vertices[used], (2, 1)),
        normals=normals,
        color_0=np.column_stack([0.5 + 0.5 * normals, np.ones(len(normals))]).astype(np.float32),
        # OpenGL draws front faces only: the back is a second surface.
        indices=np.concatenate([index, index[:, ::-1] + len(used)]),
        material=pyrender.MetallicRoughnessMaterial(baseColorFactor=(1.0, 1.0, 1.0, 1.0)),
    )
    return pyrender.Mesh([primitive])
