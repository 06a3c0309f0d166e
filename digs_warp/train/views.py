"""The photographs that training compares with: packed once, kept on the device."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.camera import Camera
from digs_warp.capture import Frame
from digs_warp.checks import DigsError
from digs_warp.log import progress
from digs_warp.losses import Box, mask_box, pack_view


@dataclass(frozen=True, eq=False)
class View:
    """One photograph: camera, pixels (packed by `pack_view`), and the box of its mask."""

    name: str
    camera: Camera
    pixels: wp.array
    content: Box


def load_views(frames: Sequence[Frame], device: str = "cpu") -> list[View]:
    """Read the images and masks of ``frames``; a frame without a mask counts as all object.

    Raises:
        DigsError: there is no frame, or the frames differ in size.
    """
    if not frames:
        raise DigsError("no training views; the capture needs at least two frames")
    sizes = sorted({(f.camera.intrinsics.width, f.camera.intrinsics.height) for f in frames})
    if len(sizes) > 1:
        raise DigsError(f"frames of different sizes {sizes}; export them at one size")
    views = []
    with progress(len(frames), "Loading views", "view") as bar:
        for frame in frames:
            image = frame.load_image()
            has_mask = frame.has("mask_path")
            mask = frame.load_mask() if has_mask else np.full(image.shape[:2], 255, np.uint8)
            pixels = wp.array(pack_view(image, mask), dtype=wp.uint8, device=device)
            views.append(View(frame.name, frame.camera, pixels, mask_box(mask)))
            bar.update()
    return views


def scene_extent(cameras: Sequence[Camera]) -> float:
    """Return the length [m] that rates of motion refer to.

    1.1 times the largest distance of a camera from the mean of all (3DGS); 1 when all are in one place.
    """
    centers = np.stack([camera.center_world for camera in cameras])
    spread = float(np.linalg.norm(centers - centers.mean(axis=0), axis=1).max())
    return 1.1 * spread if spread > 0 else 1.0
