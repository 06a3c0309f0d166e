"""A recording in another program's folder becomes a capture folder.

Where a recorded stereo pair came without depth, semi-global matching of its rectified images makes it, and
says how far each match can be trusted.
"""

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.bounds import IMAGE
from digs_warp.checks import CaptureError
from digs_warp.data.about import About
from digs_warp.data.capture import OFFSET_TAKEN, Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.images import depth_in_metres, mask_of, read_image, to_uint8
from digs_warp.data.rig import Rig
from digs_warp.formats.captures.frames import for_each_frame
from digs_warp.formats.captures.lens import register_depth, resample_depth
from digs_warp.formats.captures.recording import RecordedFrame, Recording, same_shape
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL, far_offset, rigid
from digs_warp.words import counted

# What is nearer than this many times the distance between the eyes gets no depth: the search has to end.
NEAREST_BASELINES = 4.0

# A disparity below it [px] tells little: an error of a quarter of a pixel moves the depth by a fourth.
LEAST_DISPARITY = 1.0

# Width of the square that is compared [px].
WINDOW = 5


def matched_depth(
    left: np.ndarray, right: np.ndarray, k: Intrinsics, baseline: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return depth and confidence of the left image of a rectified pair.

    Args:
        left: sRGB, (height, width, 3), uint8.
        right: of the same camera, ``baseline`` metres to the right.
        k: camera of both images.
        baseline: distance between the eyes [m].

    Returns:
        Planar depth [m], (height, width), float32, NaN where nothing matches; and the confidence in each
        match, 0 to 255, (height, width), uint8.
    """
    from digs_warp.sim.sensor.filters import gray_of
    from digs_warp.sim.sensor.guided.confidence import confidence_in_matches
    from digs_warp.sim.sensor.matcher import match

    grays = gray_of(left), gray_of(right)
    disparities = search_end(k)
    found = match(*grays, disparities, WINDOW)
    confidence = confidence_in_matches(*grays, found, disparities, WINDOW)
    found[~(found >= LEAST_DISPARITY)] = np.nan
    depth = np.float32(k.fx * baseline) / found
    return depth, to_uint8(np.where(np.isfinite(depth), confidence, 0.0))


def search_end(k: Intrinsics) -> int:
    """Return the end of the search range [px], exclusive: a multiple of 16."""
    end = min(k.fx / NEAREST_BASELINES, float(k.width))
    return 16 * max(1, int(np.ceil(end / 16)))


logger = logging.getLogger(__name__)

# A rotation that was written with few digits is off by at most this much; more is no rotation.
ROTATION_TOLERANCE = 1e-2

# If more poses are broken, those that look sound are not trusted either.
MOST_BROKEN = 0.25

# A pinhole image of which its lens shows less than this is refused; less than nearly all draws a warning.
LEAST_SEEN, NEARLY_ALL = 0.25, 0.995


def write_capture(recording: Recording, form: str, folder: Path) -> Capture:
    """Write the recording as a capture folder.

    If some frames have a pose and others do not (tracking was lost), the others are left out with a warning.
    If no frame has a pose, all get the identity, and the index says ``poses_known: false``: structure from
    motion has to find them.

    Raises:
        DigsError: no frames, an image that cannot be read, or one of another size than its camera.
    """
    frames = _usable_frames(recording)
    known = frames[0].world_from_cam is not None
    recording.say_notes()
    _check_views(recording.folder, frames)
    rig = None if recording.baseline is None else Rig(recording.baseline)
    offset = far_offset(np.array([f.world_from_cam for f in frames])[:, :3, 3]) if known else None
    taken = np.zeros(3) if offset is None else offset
    if offset is not None:
        recording.notes[OFFSET_TAKEN.format(tuple(offset.tolist()))] = len(frames)
    writer = CaptureWriter(folder, frames[0].intrinsics, rig)

    def work(number: int, frame: RecordedFrame) -> None:
        writer.write_frame(number, load_frame(frame, recording), frame.intrinsics)

    for_each_frame(frames, "Converting", work)
    recording.say_notes()
    for number, frame in enumerate(frames):
        pose = np.array(np.eye(4) if frame.world_from_cam is None else frame.world_from_cam)
        pose[:3, 3] -= taken
        own = None if frame.intrinsics == writer.intrinsics else frame.intrinsics
        writer.add_pose(number, pose, frame.time - frames[0].time, own)
    metric = known and recording.poses_in_metres
    about = About(
        recorded_as=form,
        poses_known=known,
        poses_in_metres=metric,
        world_offset=None if offset is None else tuple(offset.tolist()),
    )
    return writer.finish(about, recording.points and recording.points(taken))


def load_frame(frame: RecordedFrame, recording: Recording) -> FrameImages:
    """Return the pixels of a frame as a capture has them: metres, NaN where unknown, no distortion."""
    rgb, alpha = load_color(frame.image, "image", frame.file_camera)
    mask = alpha
    if frame.mask is not None:
        mask, note = load_mask(frame.mask, frame.file_camera)
        recording.notes.update([note] if note else [])
    right = None
    if frame.right is not None:
        view = frame.right_view or frame.view
        right, _ = load_color(frame.right, "right image", view.source if view else frame.intrinsics)
        right = right if view is None else view.apply(right)
    depth = None
    if frame.depth is not None:
        units = frame.depth_units_per_metre, frame.float_units_per_metre
        depth = depth_in_metres(read_image(frame.depth, "depth"), f"depth '{frame.depth}'", *units)
        depth = _registered(depth, frame, recording)
    if frame.view is not None:
        rgb = frame.view.apply(rgb)
        mask = None if mask is None else frame.view.apply(mask)
        depth = None if depth is None else frame.view.apply(depth, nearest=True)
    outside = None if frame.view is None else frame.view.outside()
    unknown = outside.astype(np.uint8) * 255 if outside is not None and outside.any() else None
    confidence = None
    if depth is None and right is not None and recording.baseline is not None:
        depth, confidence = matched_depth(rgb, right, frame.intrinsics, recording.baseline)
    layers = {"depth": depth, "mask": mask, "right": right, "confidence": confidence}
    return FrameImages(image=rgb, unknown=unknown, **layers)


def load_color(path: Path, what: str, k: Intrinsics) -> tuple[np.ndarray, np.ndarray | None]:
    """Return sRGB, (height, width, 3), uint8, and alpha, (height, width), if it hides anything."""
    image = read_image(path, what)
    _check_size(path, image, k)
    if image.dtype != np.uint8:
        raise CaptureError(
            f"{what} '{path}': {image.dtype}, expected 8 bits per channel; convert it to them"
        )
    rgb = np.repeat(image[..., :1], 3, axis=2) if image.shape[2] < 3 else image[..., :3]
    alpha = np.ascontiguousarray(image[..., -1]) if image.shape[2] in (2, 4) else None
    return np.ascontiguousarray(rgb), None if alpha is None or alpha.min() == 255 else alpha


def load_mask(path: Path, k: Intrinsics) -> tuple[np.ndarray, str | None]:
    """Return a mask of the size of a camera's image, as `digs_warp.data.images.mask_of` does."""
    pixels = read_image(path, "mask")
    height, width = pixels.shape[:2]
    if (width, height) != (k.width, k.height) and same_shape(k, width, height):
        rows, columns = (np.arange(n) * m // n for n, m in ((k.height, height), (k.width, width)))
        pixels = pixels[rows[:, None], columns]
    _check_size(path, pixels, k)
    return mask_of(pixels, path)


def _registered(depth: np.ndarray, frame: RecordedFrame, recording: Recording) -> np.ndarray:
    """Return the depth at the pixels of the image file."""
    k, camera = frame.file_camera, recording.depth_camera
    if camera is None:
        return resample_depth(depth, _scaled_to(k, depth, frame.depth), k)
    if (found := depth.shape[::-1]) != (
        size := (camera.intrinsics.width, camera.intrinsics.height)
    ):
        raise CaptureError(
            f"depth '{frame.depth}': {found[0]}x{found[1]} pixels, expected {size[0]}x{size[1]} as that of "
            "the first frame"
        )
    if camera.color_from_depth is None:
        return resample_depth(depth, camera.intrinsics, k)
    return register_depth(depth, camera.intrinsics, k, camera.color_from_depth)


def nearly_rigid(matrix: np.ndarray, where: str) -> np.ndarray:
    """Return a (4, 4) pose with its rotation made exact."""
    matrix = np.asarray(matrix, dtype=np.float64)
    if matrix.shape not in ((4, 4), (3, 4)) or not np.isfinite(matrix).all():
        raise CaptureError(f"{where}: expected 4 x 4 finite numbers, found shape {matrix.shape}")
    if np.abs(matrix[3:, :3]).max(initial=0.0) > ROTATION_TOLERANCE:
        raise CaptureError(
            f"{where}: its last row is {matrix[3].round(3).tolist()}, expected 0 0 0 1: is it written by "
            "columns? Transpose it"
        )
    u, singular, vt = np.linalg.svd(matrix[:3, :3])
    rotation = u @ vt
    if np.abs(singular - 1.0).max() > ROTATION_TOLERANCE or np.linalg.det(rotation) < 0:
        is_mirrored = np.abs(singular - 1.0).max() <= ROTATION_TOLERANCE
        how = "they mirror" if is_mirrored else f"they stretch by {np.round(singular, 3)}"
        raise CaptureError(
            f"{where}: the upper left 3 x 3 numbers are no rotation: {how}. Write right-handed rotations "
            "without a scale"
        )
    return rigid(rotation, matrix[:3, 3])


def _usable_frames(recording: Recording) -> Sequence[RecordedFrame]:
    """Return the frames with poses, or all if none has one, in order of time."""
    if not recording.frames:
        raise CaptureError(f"recording '{recording.folder}': no frames found in it")
    once: dict[Path, RecordedFrame] = {}
    for frame in sorted(recording.frames, key=lambda frame: frame.time):
        once.setdefault(frame.image, frame)
    if repeated := len(recording.frames) - len(once):
        recording.notes["an image is named again, and counts once"] = repeated
    frames = _without_placeholders(recording, [*once.values()])
    posed = [frame for frame in frames if frame.world_from_cam is not None]
    if posed and len(posed) < len(frames):
        logger.warning(
            "recording '%s': %d of %d frames have no pose and are left out",
            *(recording.folder, len(frames) - len(posed), len(frames)),
        )
    return _with_sound_poses(recording.folder, posed) or frames


def _without_placeholders(
    recording: Recording, frames: Sequence[RecordedFrame]
) -> list[RecordedFrame]:
    """Return the frames; poses that the file has as the identity, though most are not, become unknown."""
    posed = [frame for frame in frames if frame.world_from_cam is not None]
    # In OpenCV's and in OpenGL's axes.
    kinds = [each.tolist() for each in (np.eye(4), OPENCV_FROM_OPENGL)]
    lost = [frame for frame in posed[1:] if np.asarray(frame.world_from_cam).tolist() in kinds]
    if not 0 < 2 * len(lost) < len(posed):
        return list(frames)
    recording.notes["poses are the identity, taken for unknown"] = len(lost)
    return [replace(frame, world_from_cam=None) if frame in lost else frame for frame in frames]


def _with_sound_poses(folder: Path, posed: Sequence[RecordedFrame]) -> list[RecordedFrame]:
    """Return the frames with exact rotations, without a few that have none; more are a mistake in all."""
    sound, broken = [], []
    for frame in posed:
        try:
            pose = nearly_rigid(np.asarray(frame.world_from_cam), f"pose of '{frame.image}'")
        except CaptureError as error:
            broken.append(error)
            continue
        sound.append(replace(frame, world_from_cam=pose))
    if len(broken) > MOST_BROKEN * len(posed):
        raise broken[0]
    if broken:
        logger.warning(
            "recording '%s': %s of %d with a broken pose left out, first %s",
            *(folder, counted(len(broken), "frame"), len(posed), broken[0]),
        )
    return sound


def _check_views(folder: Path, frames: Sequence[RecordedFrame]) -> None:
    """Check that the recorded images fill the pinhole images that are made from them."""
    views = {view for frame in frames for view in (frame.view, frame.right_view) if view}
    largest = max((view.target.width * view.target.height for view in views), default=0)
    IMAGE.check(f"recording '{folder}': its camera", largest)
    seen = 1.0 - max((float(view.outside().mean()) for view in views), default=0.0)
    if seen < LEAST_SEEN:
        raise CaptureError(
            f"recording '{folder}': the recorded images show {seen:.0%} of the pinhole images that are made "
            f"from them, expected at least {LEAST_SEEN:.0%}; check the coefficients of the lens, or choose a "
            "smaller --fov-deg"
        )
    if seen < NEARLY_ALL:
        logger.warning(
            "recording '%s': %.0f%% of the pinhole images lie outside of what the lens shows, are black, and "
            "are neither trained nor scored. A smaller --fov-deg avoids it",
            *(folder, 100 * (1 - seen)),
        )


def _check_size(path: Path, pixels: np.ndarray, k: Intrinsics) -> None:
    height, width = pixels.shape[:2]
    if (height, width) != (k.height, k.width):
        on_its_side = (width, height) == (k.height, k.width)
        mend = (
            "; it lies on its side, as photographs do that have their turn in EXIF data: turn the pixels, "
            "for example with 'mogrify -auto-orient'"
            if on_its_side
            else "; give the camera of these images, or images of this size"
        )
        raise CaptureError(
            f"'{path}': {width}x{height} pixels, expected {k.width}x{k.height} as the recording's camera "
            f"says{mend}"
        )


def _scaled_to(k: Intrinsics, depth: np.ndarray, path: Path | None) -> Intrinsics:
    """The color camera at the size of the depth image."""
    height, width = depth.shape
    if not same_shape(k, width, height):
        raise CaptureError(
            f"depth '{path}': {width}x{height} pixels, another shape than the image's {k.width}x{k.height}; "
            "export depth that is registered to the color image, or give its camera: --register-depth FILE"
        )
    return k.resized(width, height)
