"""TUM RGB-D: images and 16-bit depth named by their time, with the poses in one text file.

    rgb/0.000000.png  depth/0.000000.png   rgb.txt  depth.txt   time and name of each image
    groundtruth.txt                        time tx ty tz qx qy qz qw: world from camera, OpenCV axes
    calibration.txt                        fx fy cx cy (the format itself has no place for them)

See https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats.
"""

from pathlib import Path

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture, Frame
from digs_warp.geometry import quat_xyzw_from_matrix
from digs_warp.interchange.common import (
    integer_centered,
    the_one_camera,
    write_colors_and_depths,
)
from digs_warp.record.files import write_atomically

DEPTH_UNITS_PER_METRE = 5000.0  # fixed by the format: a step of 0.2 mm, 13.1 m at most


def write_tum(capture: Capture, folder: Path) -> None:
    """Write the capture in the format of the TUM RGB-D benchmark.

    Raises:
        CaptureError: no depth, two frames of the same microsecond, or cameras that differ.
    """
    k = integer_centered(the_one_camera(capture, "TUM RGB-D"))
    stamps = [f"{frame.time:.6f}" for frame in capture.frames]
    if len(set(stamps)) < len(stamps):
        raise CaptureError(
            f"{capture}: several frames share a time, which names the files in TUM "
            "RGB-D; correct 'time' in transforms.json"
        )

    def paths(number: int) -> tuple[Path, Path]:
        return folder / f"rgb/{stamps[number]}.png", folder / f"depth/{stamps[number]}.png"

    write_colors_and_depths(capture, "TUM RGB-D", DEPTH_UNITS_PER_METRE, paths)
    for name, title in (("rgb", "color images"), ("depth", "depth maps")):
        lines = [f"# {title}", "# timestamp filename"]
        lines += [f"{stamp} {name}/{stamp}.png" for stamp in stamps]
        _write_lines(folder / f"{name}.txt", lines)
    poses = [f"{stamp} {_pose(frame)}" for stamp, frame in zip(stamps, capture.frames, strict=True)]
    header = ["# ground truth trajectory", "# timestamp tx ty tz qx qy qz qw"]
    _write_lines(folder / "groundtruth.txt", header + poses)
    calibration = [
        "# fx fy cx cy; the centre of the first pixel is (0, 0)",
        f"{k.fx} {k.fy} {k.cx} {k.cy}",
    ]
    _write_lines(folder / "calibration.txt", calibration)


def _pose(frame: Frame) -> str:
    position = frame.camera.center_world
    quaternion = quat_xyzw_from_matrix(frame.camera.world_from_cam[:3, :3])
    return " ".join(f"{value:.9f}" for value in (*position, *quaternion))


def _write_lines(path: Path, lines: list[str]) -> None:
    write_atomically(path, ("\n".join(lines) + "\n").encode())
