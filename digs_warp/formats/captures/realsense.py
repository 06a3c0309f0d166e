"""RealSense recordings (.bag) by Intel's own library, pyrealsense2: color, and depth registered to it.

A recording without color gives the left infrared image, whose camera is that of the depth.
"""

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import CaptureError, require_file
from digs_warp.data.images import write_image
from digs_warp.data.sharpness import Sharpness
from digs_warp.device.libraries import import_realsense
from digs_warp.formats.captures.lens import Lens, undistorted
from digs_warp.formats.captures.recording import RecordedFrame, Recording
from digs_warp.formats.captures.video import choose
from digs_warp.geometry.camera import Intrinsics

logger = logging.getLogger(__name__)

# librealsense gives up on a file without a frame for so long [ms].
PATIENCE = 3000

MS_PER_SECOND = 1000.0


@dataclass(frozen=True, eq=False)
class _Shot:
    """One moment of the file: image (height, width, 3), uint8; depth, uint16, or None; time [s]."""

    number: int
    image: np.ndarray
    depth: np.ndarray | None
    time: float
    intrinsics: Any


def read_bag(path: Path, scratch: Path, count: int) -> Recording:
    """Write the chosen frames of a recording to ``scratch``, and return them.

    Args:
        path: the file.
        scratch: a folder that has to live as long as the recording.
        count: the most frames to take.

    Raises:
        DigsError: pyrealsense2 is missing, the file is none of RealSense's, or it has no images.
    """
    require_file(path, "RealSense recording", "Name a file such as walk.bag.")
    rs = import_realsense()
    measure = Sharpness()
    measured = [(shot.number, measure(shot.image)) for shot in _shots(rs, path)]
    if not measured:
        raise CaptureError(f"RealSense recording '{path}': no color or infrared images in it")
    chosen = {measured[i][0] for i in choose(np.array([each for _, each in measured]), count)}
    units = 1 / _depth_scale(rs, path)
    frames = []
    for shot in _shots(rs, path):
        if shot.number not in chosen:
            continue
        chosen.remove(shot.number)  # a frame of color may come with several of depth
        frames.append(_stored(shot, scratch, path, units))
    return Recording(path, tuple(frames))


def _stored(shot: _Shot, scratch: Path, path: Path, units_per_metre: float) -> RecordedFrame:
    """Write the pixels of a frame."""
    image, depth = scratch / f"color{shot.number:06d}.png", scratch / f"depth{shot.number:06d}.png"
    write_image(image, shot.image)
    if shot.depth is not None:
        write_image(depth, shot.depth)
    k, lens = _camera(shot.intrinsics, path)
    return RecordedFrame(
        image=image,
        intrinsics=k,
        time=shot.time,
        depth=depth if shot.depth is not None else None,
        depth_units_per_metre=units_per_metre,
        view=undistorted(k, lens),
    )


def _playback(rs: Any, path: Path) -> tuple[Any, Any]:
    """Return a pipeline that plays the file, frame by frame, and its profile."""
    pipeline, config = rs.pipeline(), rs.config()
    try:
        config.enable_device_from_file(str(path), repeat_playback=False)
        profile = pipeline.start(config)
    except RuntimeError as error:
        raise CaptureError(
            f"RealSense recording '{path}': pyrealsense2 cannot play it ({error}); expected a .bag of the "
            "RealSense Viewer"
        ) from error
    profile.get_device().as_playback().set_real_time(False)
    return pipeline, profile


def _shots(rs: Any, path: Path) -> Iterator[_Shot]:
    """Yield all moments that have an image."""
    pipeline, profile = _playback(rs, path)
    kinds = {stream.stream_type() for stream in profile.get_streams()}
    align = rs.align(rs.stream.color) if {rs.stream.color, rs.stream.depth} <= kinds else None
    try:
        while True:
            arrived, frames = pipeline.try_wait_for_frames(PATIENCE)
            if not arrived:
                return
            frames = frames if align is None else align.process(frames)
            image = frames.get_color_frame() or frames.get_infrared_frame(1)
            if not image:
                continue
            depth = frames.get_depth_frame()
            yield _Shot(
                number=image.get_frame_number(),
                image=_rgb(rs, image, path),
                depth=np.array(depth.get_data()) if depth else None,
                time=image.get_timestamp() / MS_PER_SECOND,
                intrinsics=image.get_profile().as_video_stream_profile().get_intrinsics(),
            )
    finally:
        pipeline.stop()


def _rgb(rs: Any, frame: Any, path: Path) -> np.ndarray:
    """Return the pixels of an image, (height, width, 3), uint8."""
    import cv2

    pixels = np.array(frame.get_data())
    form = frame.get_profile().format()
    if form in (rs.format.rgb8, rs.format.rgba8):
        return np.ascontiguousarray(pixels[..., :3])
    if form in (rs.format.bgr8, rs.format.bgra8):
        return np.ascontiguousarray(pixels[..., 2::-1])
    if form == rs.format.y8:
        return np.repeat(pixels[..., None], 3, axis=2)
    if form == rs.format.yuyv:
        packed = pixels.view(np.uint8).reshape(*pixels.shape[:2], 2)
        return cv2.cvtColor(packed, cv2.COLOR_YUV2RGB_YUY2)
    raise CaptureError(
        f"RealSense recording '{path}': images of the format {form}, expected RGB8, BGR8, YUYV or Y8"
    )


def _depth_scale(rs: Any, path: Path) -> float:
    """Return the metres per unit of depth; a millimetre if the file has no depth camera."""
    pipeline, profile = _playback(rs, path)
    try:
        scale = float(profile.get_device().first_depth_sensor().get_depth_scale())
    except RuntimeError:
        return 1e-3
    finally:
        pipeline.stop()
    if not 0 < scale < 1:
        raise CaptureError(
            f"RealSense recording '{path}': {scale} m per unit of depth, expected 0 to 1"
        )
    return scale


def _camera(found: Any, path: Path) -> tuple[Intrinsics, Lens | None]:
    """Return the pinhole camera and what bends its light; librealsense counts pixel centers at integers."""
    size = found.width, found.height
    k = Intrinsics(*size, found.fx, found.fy, found.ppx + 0.5, found.ppy + 0.5)
    model = str(found.model).rpartition(".")[2]
    k1, k2, p1, p2, k3 = (*found.coeffs, *[0.0] * 5)[:5]
    # Since version 2.50, librealsense projects with the "inverse" model as with the other one.
    if not any(found.coeffs) or model in ("none", "brown_conrady", "inverse_brown_conrady"):
        return k, Lens.brown(k1, k2, p1, p2, k3)
    if model == "kannala_brandt4":
        return k, Lens(tuple(found.coeffs[:4]), is_fisheye=True)
    raise CaptureError(
        f"RealSense recording '{path}': lens model {model}, expected Brown-Conrady or Kannala-Brandt"
    )
