"""Which pixels an object covers, without light: rays through the pixel centers alone."""

import numpy as np

from digs_warp.geometry.camera import Camera
from digs_warp.sim.render.pixel_centers import geometry_at_pixel_centers
from digs_warp.sim.render.upload import upload_scene
from digs_warp.sim.scene.scene import Scene
from digs_warp.sim.scene.surround import Surround


class Silhouette:
    """A scene of which only the outline matters."""

    def __init__(self, scene: Scene, surround: Surround) -> None:
        self._scene = upload_scene(scene)
        self._surround = surround

    def cast(self, camera: Camera) -> np.ndarray:
        """Return where the pixel centers show the scene, (height, width), bool; holes are open."""
        seen = geometry_at_pixel_centers(self._scene.surface, camera, self._surround)
        return seen.object_ids > 0
