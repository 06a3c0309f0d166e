"""COLMAP: a sparse model with known poses, as text or binary, beside the images.

    images/0000.png
    masks/0000.png.png                                  black where features are not wanted
    sparse/0/cameras.txt  images.txt  points3D.txt      or .bin

Pixel centers are at +0.5, as here; poses are camera from world, quaternions wxyz. The points come from
the sensed depth and have no tracks: a start for splat trainers, not matches. See
https://colmap.github.io/format.html.
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.camera import Intrinsics, pixel_centers
from digs_warp.data.capture import Capture, Frame
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry import quat_xyzw_from_matrix
from digs_warp.interchange.captures.frames import copy_image, for_each_frame, object_mask
from digs_warp.record.files import write_atomically

SPARSE = "sparse/0"
PINHOLE_ID = 1  # COLMAP's number of the camera model fx, fy, cx, cy

# Enough for a splat trainer to start from; a whole recording would be millions.
MOST_POINTS = 100_000


@dataclass(frozen=True)
class _Image:
    """A line of images.txt; ids count from 1."""

    image_id: int
    camera_id: int
    name: str
    quat_wxyz: tuple[float, ...]
    translation: tuple[float, ...]


def write_colmap_text(capture: Capture, folder: Path) -> None:
    """Write the capture as a COLMAP model in text files."""
    _write(capture, folder, "txt", _cameras_text, _images_text, _points_text)


def write_colmap_binary(capture: Capture, folder: Path) -> None:
    """Write the capture as a COLMAP model in binary files."""
    _write(capture, folder, "bin", _cameras_binary, _images_binary, _points_binary)


def _write(
    capture: Capture,
    folder: Path,
    suffix: str,
    cameras_file: Callable[[Sequence[Intrinsics]], bytes],
    images_file: Callable[[Sequence[_Image]], bytes],
    points_file: Callable[[PointCloud], bytes],
) -> None:
    cameras = list(dict.fromkeys(frame.camera.intrinsics for frame in capture.frames))
    names = [f"{number:04d}.png" for number in range(len(capture))]
    per_frame = -(-MOST_POINTS // len(capture))

    def write_frame(number: int, frame: Frame) -> PointCloud:
        copy_image(frame, folder / "images" / names[number])
        if frame.has(Layer.MASK):
            mask = np.where(object_mask(frame), 255, 0).astype(np.uint8)
            write_image(folder / "masks" / f"{names[number]}.png", mask)
        return _thinned_points(frame, per_frame)

    clouds = for_each_frame(capture.frames, "Writing COLMAP", write_frame)
    points = PointCloud(
        np.concatenate([cloud.points_world for cloud in clouds]),
        np.concatenate([cloud.colors for cloud in clouds]),
    )
    images = [
        _image(number, frame, names[number], cameras) for number, frame in enumerate(capture.frames)
    ]
    for name, content in (
        ("cameras", cameras_file(cameras)),
        ("images", images_file(images)),
        ("points3D", points_file(points)),
    ):
        write_atomically(folder / SPARSE / f"{name}.{suffix}", content)


def _image(number: int, frame: Frame, name: str, cameras: Sequence[Intrinsics]) -> _Image:
    cam_from_world = frame.camera.cam_from_world
    x, y, z, w = quat_xyzw_from_matrix(cam_from_world[:3, :3]).tolist()
    camera_id = cameras.index(frame.camera.intrinsics) + 1
    translation = tuple(cam_from_world[:3, 3].tolist())
    return _Image(number + 1, camera_id, name, (w, x, y, z), translation)


def _thinned_points(frame: Frame, most: int) -> PointCloud:
    """Return at most ``most`` of the frame's depth pixels as points, evenly spread over the image."""
    if not frame.has(Layer.DEPTH):
        return PointCloud(np.zeros((0, 3)), np.zeros((0, 3)))
    depth = frame.load_depth()
    known = np.flatnonzero(np.isfinite(depth))
    chosen = known[:: max(1, -(-len(known) // most))]
    height, width = depth.shape
    centers = pixel_centers(width, height).reshape(-1, 2)[chosen]
    points = frame.camera.unproject(centers, depth.ravel()[chosen].astype(np.float64))
    return PointCloud(points, frame.load_image().reshape(-1, 3)[chosen] / 255.0)


def _cameras_text(cameras: Sequence[Intrinsics]) -> bytes:
    lines = ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, fx, fy, cx, cy"]
    for number, k in enumerate(cameras, start=1):
        lines.append(f"{number} PINHOLE {k.width} {k.height} {k.fx!r} {k.fy!r} {k.cx!r} {k.cy!r}")
    return _text(lines)


def _images_text(images: Sequence[_Image]) -> bytes:
    lines = [
        "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME",
        "# POINTS2D[] as (X, Y, POINT3D_ID): none",
    ]
    for image in images:
        pose = " ".join(repr(value) for value in (*image.quat_wxyz, *image.translation))
        lines += [f"{image.image_id} {pose} {image.camera_id} {image.name}", ""]
    return _text(lines)


def _points_text(points: PointCloud) -> bytes:
    lines = ["# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX): none"]
    rgb = _rgb_bytes(points)
    for number, (x, y, z) in enumerate(points.points_world.tolist(), start=1):
        red, green, blue = rgb[number - 1]
        lines.append(f"{number} {x:.6f} {y:.6f} {z:.6f} {red} {green} {blue} 0")
    return _text(lines)


def _cameras_binary(cameras: Sequence[Intrinsics]) -> bytes:
    records = [
        struct.pack("<IiQQ4d", number, PINHOLE_ID, k.width, k.height, k.fx, k.fy, k.cx, k.cy)
        for number, k in enumerate(cameras, start=1)
    ]
    return struct.pack("<Q", len(records)) + b"".join(records)


def _images_binary(images: Sequence[_Image]) -> bytes:
    records = [
        struct.pack("<I7dI", image.image_id, *image.quat_wxyz, *image.translation, image.camera_id)
        + image.name.encode()
        + b"\0"
        + struct.pack("<Q", 0)  # no 2D points
        for image in images
    ]
    return struct.pack("<Q", len(records)) + b"".join(records)


def _points_binary(points: PointCloud) -> bytes:
    layout = [
        ("id", "<u8"),
        ("xyz", "<f8", 3),
        ("rgb", "u1", 3),
        ("error", "<f8"),
        ("track", "<u8"),
    ]
    records = np.zeros(len(points), dtype=layout)
    records["id"] = np.arange(1, len(points) + 1)
    records["xyz"] = points.points_world
    records["rgb"] = _rgb_bytes(points)
    return struct.pack("<Q", len(points)) + records.tobytes()


def _rgb_bytes(points: PointCloud) -> np.ndarray:
    return np.round(points.colors * 255.0).astype(np.uint8)


def _text(lines: Sequence[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode()
