"""How each object of a scene appears in each frame: its pose, its whole silhouette, and what shows of it.

Whole silhouettes are cast from scenes that hold one object alone; nothing else can hide it there.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.data.objects import Box, ObjectView, matrix_rows, text_of_mask
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import mask_box
from digs_warp.sim.record.frame_maker import FrameMaker
from digs_warp.sim.render.pixel_centers import geometry_at_pixel_centers
from digs_warp.sim.render.upload import DeviceScene, upload_scene
from digs_warp.sim.scene.join import only_object
from digs_warp.sim.scene.scene import SceneObject

# Pixels beyond the projected corners: an object that stays this far from the border is not cut by it.
MARGIN = 2


@dataclass(frozen=True, eq=False)
class ObjectViews:
    """Tells how the objects appear in the frames of a recording; frames do not depend on each other."""

    maker: FrameMaker
    alone: tuple[DeviceScene, ...]
    corners: tuple[np.ndarray, ...]

    @staticmethod
    def of(maker: FrameMaker) -> "ObjectViews":
        """Prepare the scenes of single objects."""
        scene = maker.session.scene
        scenes = [only_object(scene, i + 1) for i in range(len(scene.objects))]
        corners = tuple(each.vertices.astype(np.float64) for each in scenes)
        return ObjectViews(maker, tuple(map(upload_scene, scenes)), corners)

    def in_frame(self, number: int) -> tuple[ObjectView, ...]:
        """Return the view of each object in a frame."""
        session = self.maker.session
        eye = self.maker.recorded_eye(number)
        seen = eye.geometry().object_ids
        camera = Camera(eye.intrinsics, eye.pose_at(0.0))
        bands = list(eye.cameras())
        canvas = Camera(wider(eye.intrinsics), camera.world_from_cam)
        height, width = seen.shape
        image = np.s_[height : 2 * height, width : 2 * width]
        views = []
        for i, each in enumerate(session.scene.objects):
            visible = seen == i + 1
            if is_inside(camera, self.corners[i]):
                whole = np.zeros((3 * height, 3 * width), bool)
            else:
                whole = self._alone(i, canvas)
            whole[image] = np.concatenate([self._alone(i, band) for band in bands]) | visible
            views.append(
                ObjectView(
                    number=i + 1,
                    cam_from_object=matrix_rows(cam_from_object(camera, each)),
                    pixels=int(whole.sum()),
                    pixels_visible=int(visible.sum()),
                    box=box_of(whole, width, height),
                    box_visible=box_of(visible),
                    silhouette=text_of_mask(whole[image])
                    if (whole[image] > visible).any()
                    else None,
                )
            )
        return tuple(views)

    def _alone(self, i: int, camera: Camera) -> np.ndarray:
        """Return where a camera would see an object alone, (height, width), bool; holes are open."""
        surround = self.maker.session.environment.surround
        return geometry_at_pixel_centers(self.alone[i].surface, camera, surround).object_ids > 0


def cam_from_object(camera: Camera, placed: SceneObject) -> np.ndarray:
    """Return the rigid motion from an object's file, scaled to metres, to a camera, (4, 4)."""
    world_from_object = placed.world_from_mesh.copy()
    world_from_object[:3, :3] /= np.cbrt(np.linalg.det(world_from_object[:3, :3]))
    return camera.cam_from_world @ world_from_object


def is_inside(camera: Camera, corners: np.ndarray) -> bool:
    """Whether the border of the image cuts nothing off a hull; ``corners``: in the world [m], (n, 3)."""
    px, z = camera.project(corners)
    size = np.array([camera.intrinsics.width, camera.intrinsics.height])
    return bool((z > 0).all() and ((px >= MARGIN) & (px <= size - MARGIN)).all())


def wider(k: Intrinsics) -> Intrinsics:
    """Return an image with as many pixels again on each side: what the border cuts off counts, too."""
    return Intrinsics(3 * k.width, 3 * k.height, k.fx, k.fy, k.cx + k.width, k.cy + k.height)


def box_of(mask: np.ndarray, left: int = 0, top: int = 0) -> Box | None:
    """Return the box around the pixels of a mask, from a column and row on; None: it has none."""
    x, y, right, bottom = mask_box(mask)
    return (x - left, y - top, right - x, bottom - y) if right > x else None
