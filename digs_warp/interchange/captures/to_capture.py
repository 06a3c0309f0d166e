"""A recording in another program's folder becomes a capture folder."""

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.camera import Intrinsics
from digs_warp.checks import CaptureError
from digs_warp.data.about import About
from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.images import read_image
from digs_warp.data.rig import Rig
from digs_warp.geometry import rigid
from digs_warp.interchange.captures.frames import for_each_frame
from digs_warp.interchange.captures.recording import RecordedFrame, Recording
from digs_warp.interchange.captures.resample import resample_depth, undistort
from digs_warp.record.arrays import read_array

logger = logging.getLogger(__name__)

# A rotation that was written with few digits is off by at most this much; more is no rotation.
ROTATION_TOLERANCE = 1e-2


def write_capture(recording: Recording, form: str, folder: Path) -> Capture:
    """Write the recording as a capture folder.

    If some frames have a pose and others do not (tracking was lost), the others are left out with a warning.
    If no frame has a pose, all get the identity, and the index says ``poses_known: false``: structure from
    motion has to find them.

    Raises:
        DigsError: no frames, an image that cannot be read, or sizes that do not fit together.
    """
    frames = _usable_frames(recording)
    known = frames[0].world_from_cam is not None
    sizes = {(frame.intrinsics.width, frame.intrinsics.height) for frame in frames}
    if len(sizes) > 1:
        raise CaptureError(
            f"recording '{recording.folder}': images of {len(sizes)} sizes ({sorted(sizes)}), expected one; "
            "leave the others out"
        )
    rig = None if recording.baseline is None else Rig(recording.baseline)
    writer = CaptureWriter(folder, frames[0].intrinsics, rig)

    def work(number: int, frame: RecordedFrame) -> None:
        writer.write_frame(number, load_frame(frame, recording))

    for_each_frame(frames, "Converting", work)
    for number, frame in enumerate(frames):
        pose = np.eye(4) if frame.world_from_cam is None else frame.world_from_cam
        own = None if frame.intrinsics == writer.intrinsics else frame.intrinsics
        writer.add_pose(number, pose, frame.time - frames[0].time, own)
    return writer.finish(About(recorded_as=form, poses_known=known))


def load_frame(frame: RecordedFrame, recording: Recording) -> FrameImages:
    """Return the pixels of a frame as a capture has them: metres, NaN where unknown, no distortion."""
    image = read_image(frame.image, "image")
    k = frame.intrinsics
    _check_size(frame.image, image, k)
    if image.dtype != np.uint8:
        raise CaptureError(f"image '{frame.image}': {image.dtype}, expected 8 bits per channel")
    mask = None
    if frame.mask is not None:
        pixels = read_image(frame.mask, "mask")
        _check_size(frame.mask, pixels, k)
        # Some programs write 0 and 1.
        mask = pixels[..., 0].astype(np.uint8) * (255 if pixels.max() == 1 else 1)
    elif image.shape[2] == 4:
        mask = np.ascontiguousarray(image[..., 3])
    rgb = np.repeat(image[..., :1], 3, axis=2) if image.shape[2] < 3 else image[..., :3]
    right = None if frame.right is None else read_image(frame.right, "right image")[..., :3]
    depth = None
    if frame.depth is not None:
        depth = load_depth(frame.depth, frame.depth_units_per_metre)
        depth = resample_depth(
            depth, recording.depth_camera or _scaled_to(k, depth, frame.depth), k
        )
    if recording.distortion:
        rgb, depth, mask = undistort(rgb, depth, mask, k, recording.distortion)
    return FrameImages(
        image=np.ascontiguousarray(rgb),
        depth=depth,
        mask=mask,
        right=None if right is None else np.ascontiguousarray(right),
    )


def load_depth(path: Path, units_per_metre: float) -> np.ndarray:
    """Return planar depth [m], (height, width), float32, NaN where 0, negative, NaN or infinite.

    ``units_per_metre`` is for images of integers; images of floats hold metres.
    """
    if path.suffix == ".npy":
        pixels = read_array(path, "depth")
        pixels = pixels.reshape(pixels.shape[0], pixels.shape[1], -1)
    else:
        pixels = read_image(path, "depth")
    depth = pixels[..., 0].astype(np.float32)
    if pixels.dtype.kind in "ui":
        depth /= np.float32(units_per_metre)
    depth[~(np.isfinite(depth) & (depth > 0))] = np.nan
    return depth


def nearly_rigid(matrix: np.ndarray, where: str) -> np.ndarray:
    """Return a (4, 4) pose with its rotation made exact.

    Raises:
        CaptureError: not finite, or not a rotation, even if few digits are allowed for.
    """
    matrix = np.asarray(matrix, dtype=np.float64)
    if matrix.shape not in ((4, 4), (3, 4)) or not np.isfinite(matrix).all():
        raise CaptureError(f"{where}: expected 4 x 4 finite numbers, found shape {matrix.shape}")
    u, singular, vt = np.linalg.svd(matrix[:3, :3])
    rotation = u @ vt
    if np.abs(singular - 1.0).max() > ROTATION_TOLERANCE or np.linalg.det(rotation) < 0:
        raise CaptureError(
            f"{where}: the upper left 3 x 3 numbers are no rotation (stretched by {singular}); a pose that "
            "also scales or mirrors is not usable"
        )
    return rigid(rotation, matrix[:3, 3])


def _usable_frames(recording: Recording) -> Sequence[RecordedFrame]:
    if not recording.frames:
        raise CaptureError(f"recording '{recording.folder}': no frames found in it")
    posed = [frame for frame in recording.frames if frame.world_from_cam is not None]
    if posed and len(posed) < len(recording.frames):
        logger.warning(
            "recording '%s': %d of %d frames have no pose and are left out",
            *(recording.folder, len(recording.frames) - len(posed), len(recording.frames)),
        )
    return [
        replace(
            frame, world_from_cam=nearly_rigid(frame.world_from_cam, f"pose of '{frame.image}'")
        )
        for frame in posed
        if frame.world_from_cam is not None
    ] or recording.frames


def _check_size(path: Path, pixels: np.ndarray, k: Intrinsics) -> None:
    if pixels.shape[:2] != (k.height, k.width):
        raise CaptureError(
            f"'{path}': {pixels.shape[1]}x{pixels.shape[0]} pixels, expected {k.width}x{k.height} as the "
            "recording's camera says"
        )


def _scaled_to(k: Intrinsics, depth: np.ndarray, path: Path) -> Intrinsics:
    """The color camera at the size of the depth image."""
    height, width = depth.shape
    if abs(width * k.height - height * k.width) > max(k.width, k.height):
        raise CaptureError(
            f"depth '{path}': {width}x{height} pixels, another shape than the image's {k.width}x{k.height}; "
            "export depth that is registered to the colour image"
        )
    return k.resized(width, height)
