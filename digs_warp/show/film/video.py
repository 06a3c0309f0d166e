"""Files of a film: a video, an animated GIF, or a folder of PNG files."""

import struct
from collections.abc import Iterable, Iterator
from io import BytesIO
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.images import write_image
from digs_warp.record.disk import out_of_space
from digs_warp.record.files import new_file, write_atomically

# VP9 in MP4: the wheel of OpenCV can write it, and browsers play it.
MP4_CODEC = "vp09"
SUFFIXES = (".mp4", ".gif")

# A box of an MP4 file begins with its size and kind.
_BOX = struct.Struct(">I4s")

# Disks give out room in pages of this many bytes.
_PAGE = 4096


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
    frames = _at_least_one(frames, path)
    return (_write_mp4 if suffix == ".mp4" else _write_gif)(path, frames, frame_rate)


def write_frames(folder: Path, frames: Iterable[np.ndarray]) -> int:
    """Write frames as ``0000.png``, ``0001.png``, ... into a folder and return their number."""
    count = 0
    for frame in frames:
        write_image(folder / f"{count:04d}.png", frame)
        count += 1
    return count


def _at_least_one(frames: Iterable[np.ndarray], path: Path) -> Iterator[np.ndarray]:
    empty = True
    for frame in frames:
        empty = False
        yield frame
    if empty:
        raise DigsError(f"video '{path}': 0 frames, expected at least one")


def _write_mp4(path: Path, frames: Iterable[np.ndarray], frame_rate: float) -> int:
    with new_file(path) as unfinished:
        count = _encode_mp4(unfinished, frames, frame_rate)
        readable = _readable_frames(unfinished) if _is_complete_mp4(unfinished.read_bytes()) else 0
        if readable != count:
            raise out_of_space(path, f"{readable} of {count} frames can be read back")
    return count


def _is_complete_mp4(data: bytes) -> bool:
    """Whether the file ends where its last box ends. OpenCV reports no failed writes."""
    at, kinds = 0, set()
    while at + _BOX.size <= len(data):
        size, kind = _BOX.unpack_from(data, at)
        if size == 1:  # 64 bits follow
            size = int.from_bytes(data[at + 8 : at + 16])
        kinds.add(kind)
        at += max(size, _BOX.size)
    return at == len(data) and {b"moov", b"mdat"} <= kinds


def _readable_frames(path: Path) -> int:
    """Return how many frames of a video can be decoded."""
    import cv2

    film, count = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG), 0
    try:
        while film.grab():
            count += 1
    finally:
        film.release()
    return count


def _encode_mp4(path: Path, frames: Iterable[np.ndarray], frame_rate: float) -> int:
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
                    path.write_bytes(bytes(_PAGE))  # a full disk is a reason, too: raises
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
    data = BytesIO()
    duration = max(20, round(1e3 / frame_rate))
    images[0].save(
        data, format="GIF", save_all=True, append_images=images[1:], duration=duration, loop=0
    )
    write_atomically(path, data.getvalue())
    return len(images)
