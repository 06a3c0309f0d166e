"""The labels of one frame, made where they are asked for."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.layers import Layer
from digs_warp.sim.camera.shutter import Shutter, ShutteredEye
from digs_warp.sim.record.labels.disparity import pair_disparity
from digs_warp.sim.record.labels.flow import flow_to_next
from digs_warp.sim.record.labels.seen import Seen
from digs_warp.sim.record.session import ObjectPixels, Session
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.infrared.color_camera import ColorView


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
        right = Seen.by(right_eye)
        images: dict[Layer, np.ndarray] = {}
        if "right" in wanted:
            assert truth.right_mask is not None  # every session renders it
            images |= {Layer.DEPTH_RIGHT: right.depth, Layer.MASK_RIGHT: truth.right_mask}
        if "disparity" in wanted:
            left = Seen(left_eye.middle_track, truth.depth, truth.material_ids)
            pair = pair_disparity(session.renderer, left, right)
            images |= {
                Layer.DISPARITY: pair.left,
                Layer.DISPARITY_RIGHT: pair.right,
                Layer.OCCLUSION: pair.occlusion_left,
                Layer.OCCLUSION_RIGHT: pair.occlusion_right,
            }
        return images

    def _flow(self, next_shutter: Shutter) -> dict[Layer, np.ndarray]:
        session, number = self.session, self.truth.number
        view = self.truth if self.color is None else self.color
        eye: ShutteredEye = session.image_eye(number, self.shutter)
        seen = Seen(eye.middle_track, view.depth, view.material_ids)
        later = session.image_eye(number + 1, next_shutter).middle_track
        flow = flow_to_next(session.renderer, seen, later, session.rig.baseline)
        return {Layer.FLOW: flow.field, Layer.FLOW_OCCLUSION: flow.occlusion}
