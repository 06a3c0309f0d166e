"""COLMAP: a sparse model with known poses, binary or as text, beside the images.

    images/0000.png
    masks/0000.png.png                                  black where features are not wanted
    sparse/0/cameras.bin  images.bin  points3D.bin      or .txt

Pixel centers are at +0.5, as here; poses are camera from world, quaternions wxyz. The points are a start for
splat trainers, not matches: they come from the sensed depth, and their tracks list the training images whose
depth confirms them, at their projections.
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import to_uint8
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.frames import (
    copy_image,
    for_each_frame,
    sightings,
    start_points,
    write_mask,
)
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import quat_xyzw_from_matrix
from digs_warp.record.files import write_atomically

PINHOLE_ID = 1  # COLMAP's number of the camera model fx, fy, cx, cy


@dataclass(frozen=True, eq=False)
class ModelImage:
    """A registered image.

    Attributes:
        camera_id: counts from 1.
        name: relative to the folder of images.
        quat_wxyz, translation: camera from world [m].
        px: where it shows points, shape (k, 2), the center of the first pixel at (0.5, 0.5).
        points: which ones, indices from 0, shape (k,).
    """

    camera_id: int
    name: str
    quat_wxyz: tuple[float, ...]
    translation: tuple[float, ...]
    px: np.ndarray
    points: np.ndarray


@dataclass(frozen=True, eq=False)
class ColmapModel:
    """What the three files say. Numbers in files count from 1, in the order of the lists.

    Attributes:
        cameras: the different ones.
        images: in order.
        points_world: shape (n, 3) [m].
        rgb: their colors, shape (n, 3), uint8.
    """

    cameras: Sequence[Intrinsics]
    images: Sequence[ModelImage]
    points_world: np.ndarray
    rgb: np.ndarray

    def tracks(self) -> list[np.ndarray]:
        """Return for each point its (image id, index of the 2D point in the image), shape (k, 2), uint32."""
        points = np.concatenate([image.points for image in self.images])
        entries = np.concatenate(
            [
                np.stack([np.full(len(image.points), number), np.arange(len(image.points))], axis=1)
                for number, image in enumerate(self.images, start=1)
            ]
        ).astype("<u4")
        order = np.argsort(points, kind="stable")
        ends = np.cumsum(np.bincount(points, minlength=len(self.points_world)))
        return np.split(entries[order], ends[:-1]) if len(ends) else []


def text_files(model: ColmapModel) -> dict[str, bytes]:
    """Return the files of the model in text form, by name."""
    cameras = ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, fx, fy, cx, cy"]
    for number, k in enumerate(model.cameras, start=1):
        cameras.append(f"{number} PINHOLE {k.width} {k.height} {k.fx!r} {k.fy!r} {k.cx!r} {k.cy!r}")
    images = [
        "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME",
        "# POINTS2D[] as (X, Y, POINT3D_ID)",
    ]
    for number, image in enumerate(model.images, start=1):
        pose = " ".join(repr(value) for value in (*image.quat_wxyz, *image.translation))
        seen = zip(image.px.tolist(), (image.points + 1).tolist(), strict=True)
        images.append(f"{number} {pose} {image.camera_id} {image.name}")
        images.append(" ".join(f"{u!r} {v!r} {point}" for (u, v), point in seen))
    points = ["# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)"]
    rows = zip(model.points_world.tolist(), model.rgb.tolist(), model.tracks(), strict=True)
    for number, (position, color, track) in enumerate(rows, start=1):
        words = [number, *map(repr, position), *color, 0, *track.ravel().tolist()]
        points.append(" ".join(map(str, words)))
    lines = {"cameras.txt": cameras, "images.txt": images, "points3D.txt": points}
    return {name: ("\n".join(content) + "\n").encode() for name, content in lines.items()}


def binary_files(model: ColmapModel) -> dict[str, bytes]:
    """Return the files of the model in binary form, by name."""
    records = {
        "cameras.bin": [
            struct.pack("<IiQQ4d", number, PINHOLE_ID, k.width, k.height, k.fx, k.fy, k.cx, k.cy)
            for number, k in enumerate(model.cameras, start=1)
        ],
        "images.bin": [_image_record(*item) for item in enumerate(model.images, start=1)],
        "points3D.bin": _point_records(model),
    }
    return {name: struct.pack("<Q", len(rows)) + b"".join(rows) for name, rows in records.items()}


def _image_record(number: int, image: ModelImage) -> bytes:
    seen = np.empty(len(image.points), dtype=[("px", "<f8", 2), ("point", "<u8")])
    seen["px"], seen["point"] = image.px, image.points + 1
    pose = *image.quat_wxyz, *image.translation
    head = struct.pack("<I7dI", number, *pose, image.camera_id)
    return head + image.name.encode() + b"\0" + struct.pack("<Q", len(seen)) + seen.tobytes()


def _point_records(model: ColmapModel) -> list[bytes]:
    rows = zip(model.points_world.tolist(), model.rgb.tolist(), model.tracks(), strict=True)
    return [
        struct.pack("<Q3d3BdQ", number, *position, *color, 0.0, len(track)) + track.tobytes()
        for number, (position, color, track) in enumerate(rows, start=1)
    ]


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
