"""The labels of one frame: disparity, optical flow, visible objects, amodal masks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.layers import Layer
from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.record.session import ObjectPixels, Session
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.infrared.registration import ColorView


@dataclass(frozen=True, eq=False)
class LabeledFrame:
    """A frame whose labels can be made; they need no other frame, only the place of the camera in the next.

    Attributes:
        session: the scene and the walk.
        truth: of the two eyes.
        color: what the color camera beside an infrared pair sees; None: the left eye takes the images.
        objects: where the recorded image shows the objects.
        shutter: of this frame.
        next_shutter: of the next frame; None: this is the last one.
    """

    session: Session
    truth: FrameTruth
    color: ColorView | None
    objects: ObjectPixels
    shutter: Shutter
    next_shutter: Shutter | None

    def images(self, wanted: Sequence[str]) -> dict[Layer, np.ndarray]:
        """Return the images of the labels named in `digs_warp.sim.record.labels.names.LABELS`."""
        images: dict[Layer, np.ndarray] = {}
        if {"right", "disparity"} & set(wanted):
            images |= self._of_pair(wanted)
        if "flow" in wanted and self.next_shutter is not None:
            images |= self._flow(self.next_shutter)
        if "normals" in wanted:
            view = self.truth if self.color is None else self.color
            images[Layer.NORMALS] = view.normals_world
        if "instances" in wanted:
            images[Layer.INSTANCES] = self.objects.object_ids.astype(np.uint8)
        return images

    def _of_pair(self, wanted: Sequence[str]) -> dict[Layer, np.ndarray]:
        """Return the labels of the two eyes. They are cast where the drifted right eye stands."""
        session, truth = self.session, self.truth
        left_eye, right_eye = session.eyes(truth.number, self.shutter, truth.drift)
        right = right_eye.geometry()
        images: dict[Layer, np.ndarray] = {}
        if "right" in wanted:
            assert truth.right_mask is not None  # every session renders it
            images |= {Layer.DEPTH_RIGHT: right.depth, Layer.MASK_RIGHT: truth.right_mask}
        if "disparity" in wanted:
            renderer = session.renderer_at(truth.number)
            eyes = left_eye.middle_track, right_eye.middle_track
            to_right = renderer.follow(eyes[0], truth.depth, eyes[1])
            to_left = renderer.follow(eyes[1], right.depth, eyes[0])
            images |= {
                # Columns in the left image minus those in the right one; NaN: nothing there.
                Layer.DISPARITY: -to_right.shift[..., 0],
                Layer.DISPARITY_RIGHT: to_left.shift[..., 0].copy(),
                Layer.OCCLUSION: to_right.occlusion,
                Layer.OCCLUSION_RIGHT: to_left.occlusion,
            }
        return images

    def _flow(self, next_shutter: Shutter) -> dict[Layer, np.ndarray]:
        """Return the motion of the image's points until the next frame, and whether that shows them.

        How far they move to the right and down, and by how much their disparity f b / Z grows [px]; NaN where
        they are behind the camera by then.
        """
        session, number = self.session, self.truth.number
        view = self.truth if self.color is None else self.color
        now = session.image_eye(number, self.shutter).middle_track
        later = session.image_eye(number + 1, next_shutter).middle_track
        moved = session.renderer.follow(now, view.depth, later)
        focal_baseline = now.intrinsics.fx * session.rig.baseline
        change = focal_baseline / moved.depth.astype(np.float64) - focal_baseline / view.depth
        field = np.concatenate([moved.shift, change[..., None].astype(np.float32)], axis=-1)
        return {Layer.FLOW: field, Layer.FLOW_OCCLUSION: moved.occlusion}
