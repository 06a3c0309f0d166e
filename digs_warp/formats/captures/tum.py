"""TUM RGB-D: images and 16-bit depth named by their time, with the poses in one text file.

docs/recordings.md has the layout. Poses are world from camera, OpenCV axes; calibration.txt (fx fy cx cy,
first pixel center at (0, 0)) is not part of the format. See
https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats.
"""

import logging
from collections import Counter
from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture
from digs_warp.data.file_names import FileNames
from digs_warp.data.frame import Frame
from digs_warp.data.images import image_size
from digs_warp.formats.captures.frames import (
    integer_centered,
    the_one_camera,
    write_colors_and_depths,
)
from digs_warp.formats.captures.recording import (
    RecordedFrame,
    Recording,
    expecting,
    in_seconds,
    placed,
    read_numbers,
)
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import quat_xyzw_from_matrix
from digs_warp.record.files import read_text, write_atomically
from digs_warp.words import counted

logger = logging.getLogger(__name__)

DEPTH_UNITS_PER_METRE = 5000.0  # fixed by the format: a step of 0.2 mm, 13.1 m at most
CALIBRATION = "calibration.txt"
TRUTH = "groundtruth.txt"

# Images and poses further apart in time [s] do not belong together (the benchmark's own limit).
LARGEST_GAP = 0.02

# fx, fy, cx, cy of the benchmark's cameras, by a part of the folder's name; used without calibration.txt.
KNOWN_CAMERAS = {
    "freiburg1": (517.3, 516.5, 318.6, 255.3),
    "freiburg2": (520.9, 521.0, 325.1, 249.7),
    "freiburg3": (535.4, 539.2, 320.1, 247.6),
}


def read_tum(folder: Path) -> Recording:
    """Read the folder of a TUM RGB-D sequence; groundtruth.txt may be missing."""
    files = FileNames(folder)
    times, images = _read_list(files, "rgb.txt")
    depth_times, depths = _read_list(files, "depth.txt")
    pose_times, poses = _read_poses(folder / TRUTH, files.notes)
    depth_of = at_the_moments(times, depth_times, folder / "depth.txt", "depth image")
    pose_of: list[int | None] = [None] * len(times)
    if poses:
        pose_of = at_the_moments(times, pose_times, folder / TRUTH, "pose")
    if without := depth_of.count(None):
        logger.warning(
            "recording '%s': %d of %d images have no depth of the same moment, to %g ms",
            *(folder, without, len(times), 1e3 * LARGEST_GAP),
        )
    k = _intrinsics(folder, image_size(images[0]))
    frames = tuple(
        RecordedFrame(
            image=image,
            intrinsics=k,
            time=time,
            world_from_cam=None if pose is None else poses[pose],
            depth=None if depth is None else depths[depth],
            depth_units_per_metre=DEPTH_UNITS_PER_METRE,
        )
        for time, image, depth, pose in zip(times, images, depth_of, pose_of, strict=True)
    )
    return Recording(folder, frames, notes=files.notes)


def at_the_moments(
    times: np.ndarray, others: np.ndarray, source: Path, what: str, gap: float = LARGEST_GAP
) -> list[int | None]:
    """Return for each image the number of what was taken at its moment; None: nothing within ``gap`` [s]."""
    nearest = [int(np.argmin(np.abs(others - time))) for time in times]
    gaps = np.abs(times - others[nearest])
    if gaps.min() > gap:
        raise CaptureError(
            f"'{source}': none of {counted(len(others), what)} was taken within {1e3 * gap:g} ms of "
            f"an image; the nearest are {float(np.median(gaps)):.3g} s away (median). If they belong to "
            "these images, correct its times"
        )
    return [i if away <= gap else None for i, away in zip(nearest, gaps, strict=True)]


def _read_list(files: FileNames, name: str) -> tuple[np.ndarray, list[Path]]:
    """Return times [s] and files of a list."""
    path = files.folder / name
    if not path.is_file():
        raise CaptureError(
            f"recording '{files.folder}': no {name} in it; is this the right --from?"
        )
    lines = map(str.strip, read_text(path, "list of a recording").splitlines())
    rows = [line.split(maxsplit=1) for line in lines if line and not line.startswith("#")]
    if not rows:
        raise CaptureError(f"'{path}': no lines, expected some of time and file name")
    with expecting(f"'{path}'", "lines of time and file name"):
        times = in_seconds([float(row[0]) for row in rows], files.notes)
        return times, [files.require(row[1], f"'{path}'") for row in rows]


def _read_poses(path: Path, notes: Counter[str]) -> tuple[np.ndarray, list[np.ndarray | None]]:
    """Return times [s] and poses of the file; None where the camera was lost."""
    if not path.is_file():
        return np.zeros(0), []
    rows = read_numbers(path, (-1, 8), "poses")
    return in_seconds(rows[:, 0], notes), [placed(row[4:], row[1:4]) for row in rows]


def _intrinsics(folder: Path, size: tuple[int, int]) -> Intrinsics:
    if (folder / CALIBRATION).is_file():
        values = read_numbers(folder / CALIBRATION, (4,), "calibration")
    else:
        known = [value for name, value in KNOWN_CAMERAS.items() if name in folder.resolve().name]
        if not known:
            raise CaptureError(
                f"recording '{folder}': TUM RGB-D has no place for the camera; write 'fx fy cx cy' into its "
                "calibration.txt (first pixel center at 0, 0)"
            )
        values = np.array(known[0])
    fx, fy, cx, cy = values
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    return Intrinsics.from_matrix(matrix, *size, first_center=0)


def write_tum(capture: Capture, folder: Path) -> None:
    """Write the capture in the format of the TUM RGB-D benchmark."""
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
    _write_lines(folder / TRUTH, header + poses)
    calibration = [
        "# fx fy cx cy; the center of the first pixel is (0, 0)",
        f"{k.fx} {k.fy} {k.cx} {k.cy}",
    ]
    _write_lines(folder / CALIBRATION, calibration)


def _pose(frame: Frame) -> str:
    position = frame.camera.center_world
    quaternion = quat_xyzw_from_matrix(frame.camera.world_from_cam[:3, :3])
    return " ".join(f"{value:.9f}" for value in (*position, *quaternion))


def _write_lines(path: Path, lines: list[str]) -> None:
    write_atomically(path, ("\n".join(lines) + "\n").encode())
