"""Renders a camera path frame by frame, and writes the film: a video or a GIF."""

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from io import BytesIO
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import CLASSIC, NO_FILTER, Gaussians
from digs_warp.data.images import to_uint8
from digs_warp.geometry.camera import Camera
from digs_warp.record.files import write_atomically
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.renderer import SplatRenderer

WHITE = (1.0, 1.0, 1.0)

# Percentile of the widths of splats that is the filter's alone, and how often a side is drawn at most.
THINNEST, MOST_TIMES = 5.0, 4


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
    times = times_as_large(gaussians, cameras[0])
    width, height = times * k.width, times * k.height
    renderer = SplatRenderer(splats, width, height, threads=threads)
    for camera in cameras:
        start = time.perf_counter()
        drawn = camera.resized(width, height)
        renderer.forward(drawn, near=near_plane(camera, center), background=background)
        image = renderer.image.to_numpy().reshape(k.height, times, k.width, times, 3)
        frame = to_uint8(image.mean(axis=(1, 3)))
        if clock is not None:
            clock.seconds.append(time.perf_counter() - start)
        yield frame


def times_as_large(gaussians: Gaussians, camera: Camera) -> int:
    """Return how many times as large a frame is drawn, to be averaged.

    Splats are no thinner than the filter in 3D made them, .55 pixels of the photographs. Where a pixel spans
    several of those, its center alone tells little of it. Splats made with another filter are drawn as large
    as they are asked for: they look right with it at one size only.
    """
    if not len(gaussians) or gaussians.screen_filter != NO_FILTER:
        return 1
    distances = np.linalg.norm(gaussians.means - camera.center_world, axis=1)
    widths = camera.intrinsics.fx * np.exp(gaussians.log_scales.min(axis=1), dtype=np.float64)
    spanned = CLASSIC.dilation**0.5 * np.percentile(distances / widths, 100 - THINNEST)
    return int(np.clip(np.round(spanned), 1, MOST_TIMES))


SUFFIXES = (".mp4", ".gif")

# H.264 at a quality at which no loss is seen (x264's scale: 0 best, 51 worst).
CODEC, QUALITY = "libx264", {"crf": "18"}


def write_video(path: Path, frames: Iterable[np.ndarray], frame_rate: float) -> int:
    """Write a ``.mp4`` (H.264) or ``.gif`` file and return the number of frames.

    The file appears under its name only when it is complete.

    Args:
        path: the file.
        frames: sRGB, shape (height, width, 3), uint8, all of one size; at least one. H.264 has whole squares
            of four pixels, so an MP4 repeats a last odd row or column.
        frame_rate: frames per second, above 0; a GIF shows at most 50 and rounds to 1/100 s.

    Raises:
        DigsError: another suffix, no frames, or the file cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise DigsError(f"video '{path}': suffix '{path.suffix}', expected {' or '.join(SUFFIXES)}")
    frames = _at_least_one(frames, path)
    return (_write_mp4 if suffix == ".mp4" else _write_gif)(path, frames, frame_rate)


def _at_least_one(frames: Iterable[np.ndarray], path: Path) -> Iterator[np.ndarray]:
    empty = True
    for frame in frames:
        empty = False
        yield frame
    if empty:
        raise DigsError(f"video '{path}': 0 frames, expected at least one")


def _write_mp4(path: Path, frames: Iterable[np.ndarray], frame_rate: float) -> int:
    import av

    data, count = BytesIO(), 0
    with av.open(data, "w", format="mp4") as film:
        stream = film.add_stream(CODEC, Fraction(frame_rate).limit_denominator(1001), QUALITY)
        for frame in frames:
            height, width = frame.shape[:2]
            even = np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
            picture = av.VideoFrame.from_ndarray(even).reformat(
                format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG"
            )
            if count == 0:
                stream.width, stream.height, stream.pix_fmt = (
                    picture.width,
                    picture.height,
                    "yuv420p",
                )
                # BT.709, as `reformat` made it: players guess by the size otherwise.
                stream.colorspace = stream.color_primaries = stream.color_trc = 1
            film.mux(stream.encode(picture))
            count += 1
        film.mux(stream.encode(None))
    write_atomically(path, data.getvalue())
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
