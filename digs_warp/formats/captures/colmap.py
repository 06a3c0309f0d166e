"""COLMAP: a sparse model with known poses, binary or as text, beside the images.

    images/0000.png
    masks/0000.png.png                                  black where features are not wanted
    sparse/0/cameras.bin  images.bin  points3D.bin      or .txt

Pixel centers are at +0.5, as here; poses are camera from world, quaternions wxyz. The points are a start for
splat trainers, not matches: they come from the sensed depth, and their tracks list the training images whose
depth confirms them, at their projections.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import to_uint8
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.colmap_model import (
    ColmapModel,
    ModelImage,
    binary_files,
    text_files,
)
from digs_warp.formats.captures.frames import copy_image, for_each_frame, write_mask
from digs_warp.formats.captures.start_points import sightings, start_points
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import quat_xyzw_from_matrix
from digs_warp.record.files import write_atomically

SPARSE = "sparse/0"


def write_colmap_binary(capture: Capture, folder: Path) -> None:
    """Write the capture as a COLMAP model in binary files, which nearly all splat trainers want."""
    _write(capture, folder, binary_files)


def write_colmap_text(capture: Capture, folder: Path) -> None:
    """Write the capture as a COLMAP model in text files."""
    _write(capture, folder, text_files)


def _write(
    capture: Capture, folder: Path, files: Callable[[ColmapModel], dict[str, bytes]]
) -> None:
    names = [f"{number:04d}.png" for number in range(len(capture))]

    def write_frame(number: int, frame: Frame) -> None:
        copy_image(frame, folder / "images" / names[number])
        if frame.has(Layer.MASK):
            write_mask(frame, folder / "masks" / f"{names[number]}.png")

    for_each_frame(capture.frames, "Writing COLMAP", write_frame)
    for name, content in files(_model(capture, names)).items():
        write_atomically(folder / SPARSE / name, content)


def _model(capture: Capture, names: Sequence[str]) -> ColmapModel:
    cameras = list(dict.fromkeys(frame.camera.intrinsics for frame in capture.frames))
    start = start_points(capture)
    points_world = start.cloud.points_world.astype(np.float64)
    images = [
        _image(frame, name, cameras, points_world, seen)
        for frame, name, seen in zip(capture.frames, names, sightings(capture, start), strict=True)
    ]
    return ColmapModel(cameras, images, points_world, to_uint8(start.cloud.colors))


def _image(
    frame: Frame,
    name: str,
    cameras: Sequence[Intrinsics],
    points_world: np.ndarray,
    seen: np.ndarray,
) -> ModelImage:
    cam_from_world = frame.camera.cam_from_world
    x, y, z, w = quat_xyzw_from_matrix(cam_from_world[:3, :3]).tolist()
    px, _ = frame.camera.project(points_world[seen])
    return ModelImage(
        cameras.index(frame.camera.intrinsics) + 1,
        name,
        (w, x, y, z),
        tuple(cam_from_world[:3, 3].tolist()),
        px,
        seen,
    )
