"""The labels of one frame: disparity, optical flow, visible objects, amodal masks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.layers import Layer
from digs_warp.sim.camera.shutter import Shutter, ShutteredEye
from digs_warp.sim.record.session import ObjectPixels, Session
from digs_warp.sim.render.protocol import CameraTrack, Renderer
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.infrared.registration import ColorView


@dataclass(frozen=True, eq=False)
class Seen:
    """Surfaces in the middle of each row's exposure.

    Attributes:
        track: the eye: one pose for each band of rows.
        depth: planar z [m], (height, width), float32.
        material_ids: (height, width), int32; -1: the surround.
    """

    track: CameraTrack
    depth: np.ndarray
    material_ids: np.ndarray

    @staticmethod
    def by(eye: ShutteredEye) -> "Seen":
        """Return what an eye sees."""
        seen = eye.geometry()
        return Seen(eye.middle_track, seen.depth, seen.material_ids)


@dataclass(frozen=True, eq=False)
class PairDisparity:
    """True disparity of a stereo pair; all of shape (height, width).

    Attributes:
        left: column in the left image minus that in the right one [px], float32; NaN: nothing there.
        right: the same for the pixels of the right image.
        occlusion_left: whether the right image shows the points of the left one, uint8; see
            `digs_warp.data.layers.Occlusion`.
        occlusion_right: the other way round.
    """

    left: np.ndarray
    right: np.ndarray
    occlusion_left: np.ndarray
    occlusion_right: np.ndarray


def pair_disparity(renderer: Renderer, left: Seen, right: Seen) -> PairDisparity:
    """Return the disparity between what two eyes see at the same time."""
    to_right = renderer.follow(left.track, left.depth, left.material_ids, right.track)
    to_left = renderer.follow(right.track, right.depth, right.material_ids, left.track)
    return PairDisparity(
        left=-to_right.shift[..., 0],
        right=to_left.shift[..., 0].copy(),
        occlusion_left=to_right.occlusion,
        occlusion_right=to_left.occlusion,
    )


@dataclass(frozen=True, eq=False)
class FlowToNext:
    """The motion of an image's points.

    Attributes:
        field: how far a point moves to the right and down, and by how much its disparity f b / Z grows [px],
            (height, width, 3), float32; NaN where it is behind the camera by then.
        occlusion: whether the next image shows it, (height, width), uint8; see
            `digs_warp.data.layers.Occlusion`.
    """

    field: np.ndarray
    occlusion: np.ndarray


def flow_to_next(renderer: Renderer, seen: Seen, later: CameraTrack, baseline: float) -> FlowToNext:
    """Return the motion of the points of an image until the next frame.

    Args:
        renderer: of the scene.
        seen: the image.
        later: the same camera during the next frame.
        baseline: of the eyes [m].
    """
    moved = renderer.follow(seen.track, seen.depth, seen.material_ids, later)
    focal_baseline = seen.track.intrinsics.fx * baseline
    change = focal_baseline / moved.depth.astype(np.float64) - focal_baseline / seen.depth
    field = np.concatenate([moved.shift, change[..., None].astype(np.float32)], axis=-1)
    return FlowToNext(field, moved.occlusion)


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
            pair = pair_disparity(session.renderer_at(truth.number), left, right)
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
