"""How each object of a scene appears in each frame: its pose, its whole silhouette, and what shows of it.

Whole silhouettes are cast from scenes that hold one object alone; nothing else can hide it there.
"""

from dataclasses import dataclass, replace

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
        return ObjectViews(
            maker,
            tuple(map(upload_scene, scenes)),
            tuple(each.vertices.astype(np.float64) for each in scenes),
        )

    def in_frame(self, number: int) -> tuple[ObjectView, ...]:
        """Return the view of each object in a frame."""
        session = self.maker.session
        eye = self.maker.recorded_eye(number)
        seen = eye.geometry().object_ids
        camera = Camera(eye.intrinsics, eye.pose_at(0.0))
        bands = list(eye.cameras())
        views = []
        for i, each in enumerate(session.scene.objects):
            visible = seen == i + 1
            whole = np.concatenate([self._alone(i, band) for band in bands]) | visible
            pixels, box = int(whole.sum()), box_of(whole)
            canvas = wider_canvas(camera, self.corners[i])
            if canvas is not None:
                outside, box = self._beyond_the_border(i, camera, canvas, box)
                pixels += outside
            views.append(
                ObjectView(
                    number=i + 1,
                    cam_from_object=matrix_rows(cam_from_object(camera, each)),
                    pixels=pixels,
                    pixels_visible=int(visible.sum()),
                    box=box,
                    box_visible=box_of(visible),
                    silhouette=text_of_mask(whole) if (whole > visible).any() else None,
                )
            )
        return tuple(views)

    def _alone(self, i: int, camera: Camera) -> np.ndarray:
        """Return where a camera would see an object alone, (height, width), bool; holes are open."""
        surround = self.maker.session.environment.surround
        return geometry_at_pixel_centers(self.alone[i].surface, camera, surround).object_ids > 0

    def _beyond_the_border(
        self, i: int, camera: Camera, canvas: tuple[Intrinsics, int, int], inside: Box | None
    ) -> tuple[int, Box | None]:
        """Return how many pixels an object has outside the image, and the box around all."""
        k = camera.intrinsics
        wide, left, top = canvas
        outside = self._alone(i, Camera(wide, camera.world_from_cam))
        outside[top : top + k.height, left : left + k.width] = False
        found = box_of(outside)
        if found is None:
            return 0, inside
        x, y, width, height = found
        boxes = [(x - left, y - top, width, height)]
        return int(outside.sum()), joined([*boxes, inside] if inside else boxes)


def cam_from_object(camera: Camera, placed: SceneObject) -> np.ndarray:
    """Return the rigid motion from an object's file, scaled to metres, to a camera, (4, 4)."""
    world_from_object = placed.world_from_mesh.copy()
    world_from_object[:3, :3] /= np.cbrt(np.linalg.det(world_from_object[:3, :3]))
    return camera.cam_from_world @ world_from_object


def wider_canvas(camera: Camera, corners: np.ndarray) -> tuple[Intrinsics, int, int] | None:
    """Return the canvas for an object that the image border cuts, up to an image's size on each side.

    Args:
        camera: at the image size.
        corners: points whose hull holds the object, in the world [m], shape (n, 3).

    Returns:
        The canvas, and where the image begins on it: column and row. None for an object inside the image, or
        behind the camera as a whole.
    """
    k = camera.intrinsics
    px, z = camera.project(corners)
    if z.max() <= 0:
        return None
    if z.min() <= 0:
        left, top, right, bottom = k.width, k.height, k.width, k.height
    else:
        u, v = px.T
        left, right = _over(-u.min(), k.width), _over(u.max() - k.width, k.width)
        top, bottom = _over(-v.min(), k.height), _over(v.max() - k.height, k.height)
    if not (left or right or top or bottom):
        return None
    wide = replace(
        k,
        width=k.width + left + right,
        height=k.height + top + bottom,
        cx=k.cx + left,
        cy=k.cy + top,
    )
    return wide, left, top


def _over(excess: float, most: int) -> int:
    """Return how many pixels to add for corners that lie ``excess`` pixels beyond a border."""
    return min(most, int(np.ceil(excess)) + MARGIN) if excess > -MARGIN else 0


def box_of(mask: np.ndarray) -> Box | None:
    """Return the box around the pixels of a mask; None: it has none."""
    x, y, right, bottom = mask_box(mask)
    return (x, y, right - x, bottom - y) if right > x else None


def joined(boxes: list[Box]) -> Box:
    """Return the box around several, at least one."""
    x, y = min(box[0] for box in boxes), min(box[1] for box in boxes)
    right = max(box[0] + box[2] for box in boxes)
    bottom = max(box[1] + box[3] for box in boxes)
    return x, y, right - x, bottom - y
