"""A film of a moving camera becomes a recording: sharp, evenly spaced frames, without poses or depth.

The film does not say how wide the lens sees. Phones and action cameras correct the distortion of their lenses
as they record; of others, undistort the film first. Each frame is the sharpest of its neighborhood.
"""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.bounds import IMAGE
from digs_warp.checks import CaptureError, require_file
from digs_warp.data.capture import FRAME_RATE
from digs_warp.data.images import write_image
from digs_warp.data.sharpness import REPEATED, Sharpness
from digs_warp.formats.captures.recording import RecordedFrame, Recording
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.progress import progress
from digs_warp.words import counted

# The sharpest frame is sought in this share of each interval, in its middle, so that the distances between
# the chosen frames differ by less than a factor of five.
SOUGHT = 0.67


def choose(sharpness: np.ndarray, count: int) -> list[int]:
    """Return the numbers of at most ``count`` frames, ascending.

    Args:
        sharpness: of each frame of the film, in order; `REPEATED` where it is the same as the one before.
        count: at least 1.
    """
    usable = np.flatnonzero(sharpness != REPEATED)
    if len(usable) <= count:
        return usable.tolist()
    edges = np.linspace(0, len(sharpness), count + 1)
    chosen = []
    for start, end in pairwise(edges):
        margin = (1 - SOUGHT) / 2 * (end - start)
        first = round(start + margin)
        window = sharpness[first : max(round(end - margin), first + 1)]
        if len(window) and window.max() != REPEATED:
            chosen.append(first + int(np.argmax(window)))
    return chosen


logger = logging.getLogger(__name__)

# Along the longer side, the main camera of a phone sees about this much when it films [degrees].
USUAL_FOV_DEG = 65.0

# A film of which less can be read than this share of what its header says is broken.
WHOLE = 0.9


def read_film(path: Path, scratch: Path, count: int, fov_deg: float | None) -> Recording:
    """Write the chosen frames of a film to ``scratch``, and return them as a recording.

    Args:
        path: the film, in any format that FFmpeg reads.
        scratch: a folder that has to live as long as the recording.
        count: the most frames to take.
        fov_deg: horizontal field of view of the camera; None: unknown.
    """
    images, size, rate = chosen_frames(path, scratch, count)
    k = _camera(path, size, fov_deg)
    return Recording(path, tuple(RecordedFrame(images[n], k, n / rate) for n in images))


def chosen_frames(
    path: Path, scratch: Path, count: int, length: int | None = None
) -> tuple[dict[int, Path], tuple[int, int], float]:
    """Write sharp frames of a film to ``scratch``; return them by number, their (width, height) and rate.

    Args:
        path: the film.
        scratch: the folder.
        count: the most frames to take.
        length: frames of which more is known; those behind are not taken. None: all.
    """
    require_file(path, "film", "Name a film such as walk.mp4.")
    sharpness, rate = _measure(path)
    if repeated := int(np.count_nonzero(sharpness == REPEATED)):
        logger.info("film '%s': %s repeat the one before", path, counted(repeated, "frame"))
    chosen = choose(sharpness[:length], count)
    size = _extract(path, scratch, chosen)
    return {number: scratch / _name(number) for number in chosen}, size, rate


def _name(number: int) -> str:
    return f"{number:06d}.png"


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a film for the block; its frames are upright, as its header says."""
    import cv2

    film = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    try:
        if not film.isOpened():
            raise CaptureError(
                f"film '{path}': cannot be opened as a film; expected MP4, MOV, MKV, AVI or another format "
                "that FFmpeg reads. Convert it with 'ffmpeg -i FILM film.mp4'"
            )
        size = film.get(cv2.CAP_PROP_FRAME_WIDTH), film.get(cv2.CAP_PROP_FRAME_HEIGHT)
        IMAGE.check(f"film '{path}'", int(size[0] * size[1]))
        yield film
    finally:
        film.release()


def _measure(path: Path) -> tuple[np.ndarray, float]:
    """Return the sharpness of each frame, and frames per second."""
    import cv2

    measure = Sharpness()
    found: list[float] = []
    with _opened(path) as film:
        promised = max(int(film.get(cv2.CAP_PROP_FRAME_COUNT)), 0)
        rate = float(film.get(cv2.CAP_PROP_FPS))
        with progress(promised, "Looking for sharp frames", "frame") as bar:
            while (read := film.read())[0]:
                found.append(measure(read[1]))
                bar.update()
    if not found:
        raise CaptureError(
            f"film '{path}': {promised} frames announced, none can be decoded; truncated or damaged, copy or "
            "export it again"
        )
    if len(found) < WHOLE * promised:
        logger.warning(
            "film '%s': breaks off after %d of %d frames; what is there is used",
            *(path, len(found), promised),
        )
    return np.array(found), rate if np.isfinite(rate) and 0 < rate < 1e6 else FRAME_RATE


def _extract(path: Path, scratch: Path, chosen: list[int]) -> tuple[int, int]:
    """Write the chosen frames as PNG, and return their (width, height)."""
    import cv2

    size = (0, 0)
    wanted = set(chosen)
    with _opened(path) as film, progress(len(chosen), "Reading the film", "frame") as bar:
        for number in range(max(chosen) + 1):
            if not film.grab():
                break
            if number in wanted:
                _, image = film.retrieve()
                rgb = cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
                write_image(scratch / _name(number), rgb)
                size = rgb.shape[1], rgb.shape[0]
                bar.update()
    return size


def _camera(path: Path, size: tuple[int, int], fov_deg: float | None) -> Intrinsics:
    if fov_deg is not None:
        return Intrinsics.from_fov(*size, fov_deg)
    logger.warning(
        "film '%s': its field of view is unknown, and taken for %g degrees along the longer side. Name "
        "it with --fov-deg, or let 'digs-warp reconstruct' estimate it with --poses sfm --refine-focal",
        *(path, USUAL_FOV_DEG),
    )
    focal = 0.5 * max(size) / float(np.tan(np.deg2rad(USUAL_FOV_DEG / 2)))
    return Intrinsics(*size, focal, focal, size[0] / 2, size[1] / 2)
