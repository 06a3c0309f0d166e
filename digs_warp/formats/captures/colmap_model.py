"""A COLMAP model in memory, and as text and binary files; see https://colmap.github.io/format.html."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.geometry.camera import Intrinsics

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
