"""Files of a film: a video, an animated GIF, or a folder of PNG files."""

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.images import write_image

# VP9 in MP4: the wheel of OpenCV can write it, and browsers play it.
MP4_CODEC = "vp09"
SUFFIXES = (".mp4", ".gif")


def write_video(path: Path, frames: Iterable[np.ndarray], frame_rate: float) -> int:
    """Write a ``.mp4`` (VP9) or ``.gif`` file and return the number of frames.

    The file appears under its name only when it is complete.

    Args:
        path: the file.
        frames: sRGB, shape (height, width, 3), uint8, all of one size; at least one.
        frame_rate: frames per second, above 0; a GIF shows at most 50 and rounds to 1/100 s.

    Raises:
        DigsError: another suffix, no frames, or the file cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise DigsError(f"video '{path}': suffix '{path.suffix}', expected {' or '.join(SUFFIXES)}")
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{suffix}")
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        write = _write_mp4 if suffix == ".mp4" else _write_gif
        count = write(temporary, frames, frame_rate)
        if not count or not temporary.is_file():
            raise DigsError(f"video '{path}': cannot be written ({count} frames); disk full?")
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    return count


def write_frames(folder: Path, frames: Iterable[np.ndarray]) -> int:
    """Write frames as ``0000.png``, ``0001.png``, ... into a folder and return their number."""
    count = 0
    for frame in frames:
        write_image(folder / f"{count:04d}.png", frame)
        count += 1
    return count


def _write_mp4(path: Path, frames: Iterable[np.ndarray], frame_rate: float) -> int:
    import cv2

    writer, count = None, 0
    try:
        for frame in frames:
            if writer is None:
                height, width = frame.shape[:2]
                codec = cv2.VideoWriter.fourcc(*MP4_CODEC)
                writer = cv2.VideoWriter(
                    str(path), cv2.CAP_FFMPEG, codec, frame_rate, (width, height)
                )
                if not writer.isOpened():
                    raise DigsError(
                        f"video of {width}x{height} px: this OpenCV cannot write VP9 to '{path.parent}'; "
                        "write a .gif or a folder of frames"
                    )
            writer.write(np.ascontiguousarray(frame[..., ::-1]))
            count += 1
    finally:
        if writer is not None:
            writer.release()
    return count


def _write_gif(path: Path, frames: Iterable[np.ndarray], frame_rate: float) -> int:
    from PIL import Image

    # Dithering flickers between frames; a palette for each frame makes it unnecessary.
    images = [Image.fromarray(frame).quantize(256, dither=Image.Dither.NONE) for frame in frames]
    if images:
        duration = max(20, round(1e3 / frame_rate))
        images[0].save(
            path, format="GIF", save_all=True, append_images=images[1:], duration=duration, loop=0
        )
    return len(images)
