"""What readers and writers share: work on several frames at once, 16-bit depth, integer pixel centers.

And the points that other programs' trainers start from: those that our own start takes from the depth maps.
"""

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Intrinsics
from digs_warp.init.config import InitConfig
from digs_warp.init.depth_points import NoPointsError, depth_points
from digs_warp.record.files import copy_file
from digs_warp.record.progress import progress

logger = logging.getLogger(__name__)

# As a depth, the largest number means unknown to many readers, ours among them.
LARGEST_UINT16 = 65535
LARGEST_DEPTH = LARGEST_UINT16 - 1

# Mask values above this are object in formats that only know yes and no.
OBJECT_THRESHOLD = 127

# Reading and writing images leaves the interpreter lock; more threads only cost memory.
WORKERS = 4

Item = TypeVar("Item")
Result = TypeVar("Result")


def for_each_frame(
    frames: Sequence[Item], label: str, work: Callable[[int, Item], Result]
) -> list[Result]:
    """Return ``work(number, frame)`` for all frames, in order; several run at the same time."""
    results = []
    with ThreadPoolExecutor(WORKERS, thread_name_prefix="frames") as pool:
        with progress(len(frames), label, "frame") as bar:
            for result in pool.map(work, range(len(frames)), frames):
                results.append(result)
                bar.update()
    return results


def copy_image(frame: Frame, path: Path, layer: Layer = Layer.IMAGE) -> None:
    """Write an image to ``path``, a PNG; one that is a PNG already is copied."""
    source = frame.layers.get(layer)
    if isinstance(source, Path) and source.suffix.lower() == ".png":
        copy_file(source, path)
    else:
        write_image(path, frame.load_image() if layer is Layer.IMAGE else frame.load(layer))


def object_mask(frame: Frame) -> np.ndarray:
    """Return whether each pixel is object, shape (height, width), bool."""
    return frame.load_mask() > OBJECT_THRESHOLD


def write_mask(frame: Frame, path: Path) -> None:
    """Write the object mask to ``path``, a PNG: 255 on the object, else 0."""
    write_image(path, np.where(object_mask(frame), 255, 0).astype(np.uint8))


def encode_depth(depth: np.ndarray, units_per_metre: float) -> tuple[np.ndarray, int]:
    """Return depth as 16-bit numbers, 0 where unknown, and how many pixels are too far away for them.

    Args:
        depth: planar depth [m], shape (height, width), NaN where unknown.
        units_per_metre: the number of a pixel one metre away; above 0.
    """
    units = np.round(np.nan_to_num(depth.astype(np.float64), nan=0.0) * units_per_metre)
    too_far = units > LARGEST_DEPTH
    return np.where(too_far, 0, units).astype(np.uint16), int(np.count_nonzero(too_far))


def warn_of_lost_depth(lost: int, units_per_metre: float, form: str) -> None:
    """Log how much depth a format could not hold."""
    if lost:
        farthest = LARGEST_DEPTH / units_per_metre
        logger.warning(
            "%s holds depth up to %.2f m: %d pixels further away are written as unknown",
            *(form, farthest, lost),
        )


def write_colors_and_depths(
    capture: Capture, form: str, units_per_metre: float, paths: Callable[[int], tuple[Path, Path]]
) -> None:
    """Write the left image and the depth of every frame, and warn of depth that the format cannot hold.

    Args:
        capture: has depth.
        form: name of the format.
        units_per_metre: of its depth.
        paths: where image and depth of a frame go, by its number.
    """

    def write_frame(number: int, frame: Frame) -> int:
        color_path, depth_path = paths(number)
        copy_image(frame, color_path)
        depth, lost = encode_depth(frame.load_depth(), units_per_metre)
        write_image(depth_path, depth)
        return lost

    lost = sum(for_each_frame(capture.frames, f"Writing {form}", write_frame))
    warn_of_lost_depth(lost, units_per_metre, form)


def integer_centered(intrinsics: Intrinsics) -> Intrinsics:
    """Return the camera with the center of the first pixel at (0, 0) instead of (0.5, 0.5).

    This is how OpenCV, Open3D, the TUM tools and BOP count: they back-project column 0 with u = 0.
    """
    return replace(intrinsics, cx=intrinsics.cx - 0.5, cy=intrinsics.cy - 0.5)


def the_one_camera(capture: Capture, form: str) -> Intrinsics:
    """Return the intrinsics that all frames share, for formats with only one camera."""
    found = {frame.camera.intrinsics for frame in capture.frames}
    if len(found) > 1:
        raise CaptureError(
            f"{capture}: {len(found)} different cameras, but {form} has one for all "
            "frames; export to colmap or bop, which have a camera per frame"
        )
    return found.pop()


_NO_POINTS = PointCloud(np.zeros((0, 3)), np.zeros((0, 3)))


def start_points(capture: Capture) -> PointCloud:
    """Return the points that `digs-warp reconstruct` starts from by default, with the recorded poses.

    They are the object's if the capture has masks, else the scene's; of photographs those that came with
    them. Held-out frames do not contribute.
    """
    training = capture.split()[0] or list(capture.frames)
    with_depth = [frame for frame in training if frame.has(Layer.DEPTH)]
    with_mask = [frame for frame in with_depth if frame.has(Layer.MASK)]
    cloud = _NO_POINTS
    try:
        if with_mask:
            cloud, _ = depth_points(with_mask, InitConfig())
        elif with_depth:
            cloud, _ = depth_points(with_depth, InitConfig(), subject="scene")
        else:
            cloud = capture.load_points() or cloud
    except NoPointsError as error:
        logger.warning("%s: exported without points to start from: %s", capture, error)
    return cloud
