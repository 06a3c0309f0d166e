"""What phones with a depth camera leave: Polycam's raw data and Stray Scanner's folders.

Polycam (raw data of LiDAR or room mode, https://github.com/PolyCam/polyform), OpenGL axes, y up:

    keyframes/images/TIME.jpg  depth/TIME.png   depth in millimetres, smaller
    keyframes/cameras/TIME.json                 t_00 ... t_23 (camera to world, by rows), fx, fy, cx, cy
    keyframes/corrected_images/  corrected_cameras/    the same after Polycam's own adjustment, taken if there

Stray Scanner (https://github.com/strayrobots/scanner), OpenCV axes:

    rgb.mp4  depth/000000.png           depth in millimetres, smaller
    camera_matrix.csv  odometry.csv     K; timestamp, frame, x, y, z, qx, qy, qz, qw of each frame of the film
"""

from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError, require_folder
from digs_warp.formats.captures.recording import (
    NumberedFiles,
    RecordedFrame,
    Recording,
    expecting,
    placed,
    read_numbers,
)
from digs_warp.formats.captures.video import chosen_frames
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.record.fields import ABOVE_ZERO, Fields
from digs_warp.record.files import read_json, read_text

# (x, y, z) with y up -> (z, x, y).
_Z_UP = np.eye(4)[[2, 0, 1, 3]]
# The names of Polycam's files are times in microseconds.
_PER_SECOND = 1e6


def read_polycam(folder: Path) -> Recording:
    """Read raw data of Polycam.

    Raises:
        CaptureError: no images, or a camera is missing or broken.
    """
    corrected = (folder / "keyframes/corrected_images").is_dir()
    prefix = "corrected_" if corrected else ""
    files = NumberedFiles.find(folder, f"keyframes/{prefix}images/", "keyframes/depth/")
    cameras, poses = {}, {}
    for number, image in files.images.items():
        path = folder / f"keyframes/{prefix}cameras/{image.stem}.json"
        camera = Fields(read_json(path, "camera"), f"'{path}'", CaptureError)
        size = camera.whole("width", 1), camera.whole("height", 1)
        fx, fy = (camera.number(key, ABOVE_ZERO, what="pixels above 0") for key in ("fx", "fy"))
        cameras[number] = Intrinsics(*size, fx, fy, camera.number("cx"), camera.number("cy"))
        rows = [[camera.number(f"t_{row}{column}") for column in range(4)] for row in range(3)]
        poses[number] = _Z_UP @ np.array([*rows, [0, 0, 0, 1]]) @ OPENCV_FROM_OPENGL
    return files.recording(cameras, poses, frame_rate=_PER_SECOND)


def read_stray(folder: Path, scratch: Path, count: int) -> Recording:
    """Write the chosen frames of the film to ``scratch``, and return them with their depth and poses.

    Args:
        folder: of Stray Scanner.
        scratch: a folder that has to live as long as the recording.
        count: the most frames to take.

    Raises:
        CaptureError: a file is missing or broken.
    """
    require_folder(folder, "recording", "Name the folder with rgb.mp4, odometry.csv and depth/.")
    path = folder / "odometry.csv"
    lines = read_text(path, "odometry").splitlines()[1:]
    with expecting(f"'{path}'", "timestamp, frame, x, y, z, qx, qy, qz, qw in each line"):
        rows = np.array([[float(word) for word in line.split(",")[:9]] for line in lines])
        rows = rows.reshape(-1, 9)
        times, places, turns = rows[:, 0], rows[:, 2:5], rows[:, 5:9]
    images, size, _ = chosen_frames(folder / "rgb.mp4", scratch, count, len(rows))
    matrix = read_numbers(folder / "camera_matrix.csv", (3, 3), "camera")
    k = Intrinsics.from_matrix(matrix, *size, first_center=0)
    frames = []
    for number, image in images.items():
        depth = folder / f"depth/{number:06d}.png"
        frames.append(
            RecordedFrame(
                image=image,
                intrinsics=k,
                time=float(times[number]),
                world_from_cam=placed(turns[number], places[number]),
                depth=depth if depth.is_file() else None,
            )
        )
    return Recording(folder, tuple(frames))
