"""Redwood, the format of Open3D's reconstruction: numbered images, a trajectory log, one camera.

    color/00000.png  depth/00000.png   depth in millimetres, 16 bits, 0 where unknown
    trajectory.log                     per frame "i i i+1" and four rows: world from camera, OpenCV axes
    camera_intrinsic.json              as Open3D's PinholeCameraIntrinsic reads it

See https://www.open3d.org/docs/release/tutorial/reconstruction_system/system_overview.html.
"""

from pathlib import Path

from digs_warp.data.capture import Capture, Frame
from digs_warp.interchange.common import (
    integer_centered,
    the_one_camera,
    write_colors_and_depths,
)
from digs_warp.record.files import to_json, write_atomically

DEPTH_UNITS_PER_METRE = 1000.0


def write_redwood(capture: Capture, folder: Path) -> None:
    """Write the capture as a data set for Open3D.

    Raises:
        CaptureError: no depth, or cameras that differ.
    """
    k = integer_centered(the_one_camera(capture, "Redwood"))

    def paths(number: int) -> tuple[Path, Path]:
        return folder / f"color/{number:05d}.png", folder / f"depth/{number:05d}.png"

    write_colors_and_depths(capture, "Redwood", DEPTH_UNITS_PER_METRE, paths)
    poses = "".join(_log_entry(number, frame) for number, frame in enumerate(capture.frames))
    write_atomically(folder / "trajectory.log", poses.encode())
    # Open3D lists the matrix column by column.
    camera = {"width": k.width, "height": k.height, "intrinsic_matrix": k.matrix.T.ravel()}
    write_atomically(folder / "camera_intrinsic.json", to_json(camera).encode())


def _log_entry(number: int, frame: Frame) -> str:
    rows = [" ".join(f"{value:.9f}" for value in row) for row in frame.camera.world_from_cam]
    return "\n".join([f"{number} {number} {number + 1}", *rows]) + "\n"
