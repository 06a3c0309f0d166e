"""Renders a camera path frame by frame, and writes the film: a video, a GIF, or a folder of PNG files."""

import struct
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import to_uint8, write_image
from digs_warp.geometry.camera import Camera
from digs_warp.record.disk import out_of_space
from digs_warp.record.files import new_file, write_atomically
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.renderer import SplatRenderer

WHITE = (1.0, 1.0, 1.0)


@dataclass
class Clock:
    """Seconds of every frame rendered so far; the first loads or compiles kernels."""

    seconds: list[float] = field(default_factory=list)

    @property
    def milliseconds(self) -> float:
        """Mean time of a frame [ms], without the first if there are others; NaN if there are none."""
        counted = self.seconds[1:] or self.seconds
        return 1e3 * float(np.mean(counted)) if counted else float("nan")

    @property
    def frame_rate(self) -> float:
        """Frames per second of rendering alone."""
        return 1e3 / self.milliseconds


def shoot(
    gaussians: Gaussians,
    cameras: Sequence[Camera],
    *,
    background: tuple[float, float, float] = WHITE,
    center_world: np.ndarray | None = None,
    device: str = "cpu",
    threads: int = 0,
    clock: Clock | None = None,
) -> Iterator[np.ndarray]:
    """Yield the frames of a film, sRGB, shape (height, width, 3), uint8.

    Args:
        gaussians: the scene.
        cameras: one per frame, all of one image size.
        background: sRGB color behind the Gaussians, 0..1.
        center_world: where the scene is, for the near plane [m]; default: the mean of the Gaussians.
        device: "cpu" or a CUDA device of Warp.
        threads: CPU threads; 0: all cores.
        clock: collects the time of each frame, from the camera to the pixels in memory.

    Raises:
        DigsError: cameras of different image sizes.
    """
    if not cameras:
        return
    k = cameras[0].intrinsics
    if any((c.intrinsics.width, c.intrinsics.height) != (k.width, k.height) for c in cameras):
        raise DigsError("film: cameras of different image sizes; a film has one")
    if center_world is not None:
        center = center_world
    else:
        center = gaussians.means.mean(axis=0) if len(gaussians) else np.zeros(3)
    splats = DeviceGaussians.from_numpy(gaussians, device)
    renderer = SplatRenderer(splats, k.width, k.height, threads=threads)
    for camera in cameras:
        start = time.perf_counter()
        renderer.forward(camera, near=near_plane(camera, center), background=background)
        frame = to_uint8(renderer.image.to_numpy())
        if clock is not None:
            clock.seconds.append(time.perf_counter() - start)
        yield frame


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
