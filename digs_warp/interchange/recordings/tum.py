"""TUM RGB-D: rgb.txt, depth.txt, groundtruth.txt (see `digs_warp.interchange.tum`), files matched by time.

The format has no place for the camera: calibration.txt is taken (fx fy cx cy), or the benchmark's published
figures where the folder is named after one of its three cameras.
"""

from pathlib import Path

import numpy as np

from digs_warp.camera import Intrinsics
from digs_warp.checks import CaptureError
from digs_warp.geometry import matrix_from_quat_xyzw, rigid
from digs_warp.interchange.recordings.files import image_size, intrinsics_of_matrix, read_numbers
from digs_warp.interchange.recordings.recording import RecordedFrame, Recording
from digs_warp.interchange.tum import DEPTH_UNITS_PER_METRE

# Farther apart in time [s], images and poses belong to different moments (the benchmark's own limit).
LARGEST_GAP = 0.02

# fx, fy, cx, cy of the benchmark's cameras; first pixel centre at (0, 0).
KNOWN_CAMERAS = {
    "freiburg1": (517.3, 516.5, 318.6, 255.3),
    "freiburg2": (520.9, 521.0, 325.1, 249.7),
    "freiburg3": (535.4, 539.2, 320.1, 247.6),
}


def read_tum(folder: Path) -> Recording:
    """Read the folder of a TUM RGB-D sequence; groundtruth.txt may be missing.

    Raises:
        CaptureError: lists are missing or broken, or no camera is known.
    """
    times, images = _read_list(folder, "rgb.txt")
    depth_times, depths = _read_list(folder, "depth.txt")
    pose_times, poses = _read_poses(folder / "groundtruth.txt")
    k = _intrinsics(folder, image_size(folder / images[0]))
    frames = []
    for time, image in zip(times, images, strict=True):
        depth, pose = _nearest(depth_times, time), _nearest(pose_times, time)
        frames.append(
            RecordedFrame(
                image=folder / image,
                intrinsics=k,
                time=time,
                world_from_cam=None if pose is None else poses[pose],
                depth=None if depth is None else folder / depths[depth],
                depth_units_per_metre=DEPTH_UNITS_PER_METRE,
            )
        )
    return Recording(folder, tuple(frames))


def _read_list(folder: Path, name: str) -> tuple[np.ndarray, list[str]]:
    """Return times [s] and file names of a list."""
    path = folder / name
    if not path.is_file():
        raise CaptureError(f"recording '{folder}': no {name} in it; is this the right --from?")
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = [line.split() for line in lines if line.strip() and not line.startswith("#")]
    try:
        return np.array([float(row[0]) for row in rows]), [row[1] for row in rows]
    except (ValueError, IndexError) as error:
        raise CaptureError(f"'{path}': expected lines of time and file name ({error})") from None


def _read_poses(path: Path) -> tuple[np.ndarray, list[np.ndarray]]:
    if not path.is_file():
        return np.zeros(0), []
    rows = read_numbers(path, (-1, 8), "poses")
    rotations = matrix_from_quat_xyzw(rows[:, 4:])
    return rows[:, 0], [rigid(turn, row[1:4]) for turn, row in zip(rotations, rows, strict=True)]


def _nearest(times: np.ndarray, time: float) -> int | None:
    """The index of the nearest time, or None when it is too far away."""
    if len(times) == 0:
        return None
    nearest = int(np.argmin(np.abs(times - time)))
    return nearest if abs(times[nearest] - time) <= LARGEST_GAP else None


def _intrinsics(folder: Path, size: tuple[int, int]) -> Intrinsics:
    if (folder / "calibration.txt").is_file():
        values = read_numbers(folder / "calibration.txt", (4,), "calibration")
    else:
        known = [value for name, value in KNOWN_CAMERAS.items() if name in folder.resolve().name]
        if not known:
            raise CaptureError(
                f"recording '{folder}': TUM RGB-D does not tell the camera; write 'fx fy cx cy' into its "
                "calibration.txt (first pixel centre at 0, 0)"
            )
        values = np.array(known[0])
    fx, fy, cx, cy = values
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    return intrinsics_of_matrix(matrix, size, integer_centers=True)
