"""Writes a recording of the user's own with more noise, as a capture folder."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.frame import Frame
from digs_warp.data.images import to_uint8
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.data.layers import Layer
from digs_warp.record.manifest import Content, recorded_files
from digs_warp.record.progress import progress
from digs_warp.sim.record.frame_maker import COLOR_SEED
from digs_warp.sim.sensor.infrared.pair import in_three_channels, one_channel
from digs_warp.sim.sensor.on_recordings import worse_depth, worse_images
from digs_warp.sim.testing.recording import OwnRecording

# What a camera records. Labels of a simulated recording belong to the depth that it had before.
CARRIED = (
    Layer.IMAGE,
    Layer.RIGHT,
    Layer.INFRARED_LEFT,
    Layer.INFRARED_RIGHT,
    Layer.DEPTH,
    Layer.MASK,
    Layer.CONFIDENCE,
    Layer.INSTANCES,
)


def write_noisy(recording: OwnRecording, strength: float, folder: Path) -> Capture:
    """Write the recording with errors of a strength; its own depth becomes the true depth.

    Frames that a run which was cut off has written are kept.

    Args:
        recording: what is read.
        strength: factor on the errors, >= 0; 0: the recording as it is.
        folder: where to.

    Raises:
        DigsError: a file of the recording cannot be read.
    """
    capture = recording.capture
    writer = CaptureWriter(folder, capture.frames[0].camera.intrinsics, capture.rig)
    with recorded_files(folder, resume=True) as manifest:
        manifest.drop_damaged()
        with progress(len(capture), "Adding noise", "frame") as bar:
            for number, frame in enumerate(capture.frames):
                _write(writer, number, frame, recording, strength)
                bar.update()
        effects = tuple(sorted(recording.effects)) if strength > 0 else ()
        about = replace(capture.about, effects=effects, cause_labels=None)
        return writer.finish(about, capture.load_points())


def content_of(capture: Capture) -> str:
    """Return a hash of all that `write_noisy` reads of a capture."""
    files = [frame.path(each) for frame in capture.frames for each in CARRIED if frame.has(each)]
    if capture.points is not None:
        files.append(capture.points)
    digest = hashlib.sha256()
    for path in (capture.folder / INDEX_NAME, *files):
        digest.update(Content.of_file(path).sha256.encode())
    return digest.hexdigest()


def _write(
    writer: CaptureWriter, number: int, frame: Frame, recording: OwnRecording, strength: float
) -> None:
    layers = [each for each in CARRIED if frame.has(each)]
    if frame.has(Layer.DEPTH):
        layers.append(Layer.DEPTH_TRUE)
    k = frame.camera.intrinsics
    own = None if k == writer.intrinsics else k
    if not writer.has_frame(number, layers):
        writer.write_frame(number, _noisy(frame, number, recording, strength), own)
    writer.add_pose(
        *(number, frame.camera.world_from_cam, frame.time, own),
        color_gain=frame.color_gain,
        objects=frame.objects,
        exposure=frame.exposure,
    )


def _noisy(frame: Frame, number: int, recording: OwnRecording, strength: float) -> FrameImages:
    """Return the pixels of a frame with errors of a strength."""
    image, right = _noisy_images(frame, number, recording, strength)
    infrared_left, infrared_right = _noisy_infrared(frame, number, recording, strength)
    recorded, depth = None, None
    confidence = frame.load_confidence() if frame.has(Layer.CONFIDENCE) else None
    if frame.has(Layer.DEPTH):
        recorded = frame.load_depth()
        rig = recording.depth_rig(frame.camera.intrinsics)
        depth = worse_depth(recorded, rig, recording.effects, recording.seed, number, strength)
        if confidence is not None:
            confidence[np.isnan(depth) & ~np.isnan(recorded)] = 0.0
    return FrameImages(
        image=image,
        right=right,
        infrared_left=infrared_left,
        infrared_right=infrared_right,
        depth=depth,
        depth_true=recorded,
        mask=frame.load_mask() if frame.has(Layer.MASK) else None,
        confidence=None if confidence is None else to_uint8(confidence),
        instances=frame.load_instances() if frame.has(Layer.INSTANCES) else None,
    )


def _noisy_images(
    frame: Frame, number: int, recording: OwnRecording, strength: float
) -> tuple[np.ndarray, np.ndarray | None]:
    """Return left and right image; no right one where there is none."""
    left = frame.load_image()
    has_right = frame.has(Layer.RIGHT)
    right = frame.load_right_image() if has_right else left
    rig = recording.image_rig(frame.camera.intrinsics)
    # A color camera has other noise than the infrared pair beside it.
    seed = recording.seed + COLOR_SEED
    left, right = worse_images(left, right, rig, recording.effects, seed, number, strength)
    return left, right if has_right else None


def _noisy_infrared(
    frame: Frame, number: int, recording: OwnRecording, strength: float
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return the infrared pair; nothing where it is not recorded."""
    if not (frame.has(Layer.INFRARED_LEFT) and frame.has(Layer.INFRARED_RIGHT)):
        return None, None
    left, right = (in_three_channels(eye) for eye in frame.load_infrared())
    rig = recording.depth_rig(frame.camera.intrinsics)
    seed = recording.seed
    left, right = worse_images(left, right, rig, recording.effects, seed, number, strength)
    return one_channel(left), one_channel(right)
