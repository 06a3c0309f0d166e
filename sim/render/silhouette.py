"""Which pixels an object covers, without light: rays through the pixel centers alone."""

# Warp's type hints take the dtype of an array for a value, and structs for functions.
# pyright: reportArgumentType=false, reportGeneralTypeIssues=false

import numpy as np
import warp as wp

from digs_warp.camera import Camera
from digs_warp.device.parallel import launch_parallel
from digs_warp.sim.render.kernels import geometry_kernel
from digs_warp.sim.render.upload import upload_scene
from digs_warp.sim.render.view import make_view
from digs_warp.sim.scene import Scene
from digs_warp.sim.surround import Surround


class Silhouette:
    """A scene of which only the outline matters."""

    def __init__(self, scene: Scene, surround: Surround) -> None:
        self._scene = upload_scene(scene)
        self._surround = surround

    def cast(self, camera: Camera) -> np.ndarray:
        """Return where the pixel centers show the scene, (height, width), bool; holes are open."""
        k = camera.intrinsics
        count = k.height * k.width
        depth = wp.empty(count, dtype=float, device="cpu")
        normals = wp.empty(count, dtype=wp.vec3, device="cpu")
        materials = wp.empty(count, dtype=int, device="cpu")
        objects = wp.empty(count, dtype=int, device="cpu")
        view = make_view(camera, self._surround)
        inputs = [view, self._scene.surface, depth, normals, materials, objects]
        launch_parallel(geometry_kernel, count, inputs)
        return objects.numpy().reshape(k.height, k.width) > 0
