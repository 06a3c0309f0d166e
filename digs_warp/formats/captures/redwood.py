"""Redwood, the format of Open3D's reconstruction: numbered images, a trajectory log, one camera.

Depth is in millimetres, 16 bits, 0 where unknown; trajectory.log has "i i i+1" for each frame and four rows:
world from camera, OpenCV axes; camera_intrinsic.json is as Open3D's PinholeCameraIntrinsic reads it. See
https://www.open3d.org/docs/release/tutorial/reconstruction_system/system_overview.html.
"""

from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import MM_PER_METRE
from digs_warp.formats.captures.frames import (
    integer_centered,
    the_one_camera,
    write_colors_and_depths,
)
from digs_warp.formats.captures.recording import (
    NumberedFiles,
    Recording,
    known_pose,
    read_numbers,
)
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.fields import Fields
from digs_warp.record.files import read_json, to_json, write_atomically

CAMERA = "camera_intrinsic.json"
TRAJECTORY = "trajectory.log"


def read_redwood(folder: Path) -> Recording:
    """Read a data set of Open3D's reconstruction system; trajectory.log may be missing."""
    files = NumberedFiles.find(folder, "color/", "depth/")
    camera = Fields(read_json(folder / CAMERA, "camera"), f"'{folder / CAMERA}'", CaptureError)
    matrix = camera.array("intrinsic_matrix", (3, 3)).T
    size = camera.whole("width", 1), camera.whole("height", 1)
    return files.recording(
        Intrinsics.from_matrix(matrix, *size, first_center=0),
        # Entry i belongs to the i-th image; the numbers in its head differ from program to program.
        dict(zip(files.images, _read_log(folder / TRAJECTORY), strict=False)),
    )


def _read_log(path: Path) -> list[np.ndarray | None]:
    """Return the poses, world from camera, (4, 4)."""
    if not path.is_file():
        return []
    rows = read_numbers(path, (-1, 19), "trajectory")
    return [known_pose(row[3:].reshape(4, 4)) for row in rows]


def write_redwood(capture: Capture, folder: Path) -> None:
    """Write the capture as a data set for Open3D."""
    k = integer_centered(the_one_camera(capture, "Redwood"))

    def paths(number: int) -> tuple[Path, Path]:
        return folder / f"color/{number:05d}.png", folder / f"depth/{number:05d}.png"

    write_colors_and_depths(capture, "Redwood", MM_PER_METRE, paths)
    poses = "".join(_log_entry(number, frame) for number, frame in enumerate(capture.frames))
    write_atomically(folder / TRAJECTORY, poses.encode())
    # Open3D lists the matrix column by column.
    camera = {"width": k.width, "height": k.height, "intrinsic_matrix": k.matrix.T.ravel()}
    write_atomically(folder / CAMERA, to_json(camera).encode())


def _log_entry(number: int, frame: Frame) -> str:
    rows = [" ".join(f"{value:.9f}" for value in row) for row in frame.camera.world_from_cam]
    return "\n".join([f"{number} {number} {number + 1}", *rows]) + "\n"
