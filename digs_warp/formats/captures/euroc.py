"""EuRoC MAV, and data sets in its layout (ASL): a stereo camera through its lenses, poses of its body.

    mav0/cam0/data/1403715273262142976.png   named by their time [ns]; cam1 is the right eye
    mav0/cam0/sensor.yaml                    intrinsics, distortion, T_BS: body from camera
    mav0/state_groundtruth_estimate0/data.csv   time, position, quaternion wxyz: world from body; or
    mav0/vicon0, mocap0                      the same of a marker, whose sensor.yaml has its T_BS

The images are rectified: rows in common, the left eye as the frame's camera. See
https://projects.asl.ethz.ch/datasets/doku.php?id=kmavvisualinertialdatasets.
"""

import logging
from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.images import image_size
from digs_warp.formats.captures.lens import Eye, Lens, rectify, undistorted
from digs_warp.formats.captures.recording import (
    IMAGE_SUFFIXES,
    RecordedFrame,
    Recording,
    expecting,
    numbered_files,
)
from digs_warp.formats.captures.to_capture import nearly_rigid
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import invert_rigid, matrix_from_quat_xyzw, rigid
from digs_warp.record.fields import Fields
from digs_warp.record.files import read_text, read_yaml
from digs_warp.words import counted

logger = logging.getLogger(__name__)

NANOSECONDS = 1e9

# 64 bits hold no later time.
LAST_MOMENT = 2**63

# Left and right images whose times [ns] differ by more were not taken together.
SAME_MOMENT = 1_000_000

# Poses are interpolated between measurements at most this far apart in time [s].
LONGEST_GAP = 0.1

TRUTHS = ("state_groundtruth_estimate0", "vicon0", "mocap0")
FISHEYE_NAMES = ("equidistant", "kannala-brandt", "kannala_brandt", "fisheye", "opencv_fisheye")
BROWN_NAMES = ("radial-tangential", "radtan", "plumb_bob", "brown", "none")


def read_euroc(folder: Path) -> Recording:
    """Read a sequence: the folder with mav0, or mav0 itself. Without cam1, its left images alone.

    Raises:
        CaptureError: no images, no usable sensor.yaml, or eyes that are no stereo pair.
    """
    base = folder / "mav0" if (folder / "mav0").is_dir() else folder
    lefts = _images(base, "cam0")
    if not lefts:
        raise CaptureError(
            f"recording '{folder}': no images mav0/cam0/data/TIME.png; is this the right --from?"
        )
    rights = _images(base, "cam1")
    left = _eye(base, "cam0", image_size(next(iter(lefts.values()))))
    if not rights:
        k = left.intrinsics
        view = undistorted(k, left.lens)
        poses = _poses(base, np.array(list(lefts)), left.body_from_cam)
        frames = [
            RecordedFrame(image, k, time / NANOSECONDS, pose, view=view)
            for (time, image), pose in zip(lefts.items(), poses, strict=True)
        ]
        return Recording(folder, tuple(frames))
    right = _eye(base, "cam1", image_size(next(iter(rights.values()))))
    pair = rectify(left, right, f"recording '{folder}'")
    partners = _partners(folder, lefts, rights)
    poses = _poses(base, np.array(list(partners)), pair.body_from_cam)
    frames = [
        RecordedFrame(
            image=lefts[time],
            intrinsics=pair.left.target,
            time=time / NANOSECONDS,
            world_from_cam=pose,
            right=rights[partner],
            view=pair.left,
            right_view=pair.right,
        )
        for (time, partner), pose in zip(partners.items(), poses, strict=True)
    ]
    return Recording(folder, tuple(frames), baseline=pair.baseline)


def _images(base: Path, eye: str) -> dict[int, Path]:
    """Return the images of an eye by their time [ns]."""
    places = (f"{eye}/data/", f"{eye}/")
    found = next(filter(None, (numbered_files(base, each, IMAGE_SUFFIXES) for each in places)), {})
    return {time: image for time, image in found.items() if time < LAST_MOMENT}


def _partners(folder: Path, lefts: dict[int, Path], rights: dict[int, Path]) -> dict[int, int]:
    """Return for the time of each left image that of the right image of the same moment [ns]."""
    times = np.array(list(rights))
    nearest = {time: int(times[np.argmin(np.abs(times - time))]) for time in lefts}
    found = {left: right for left, right in nearest.items() if abs(left - right) <= SAME_MOMENT}
    if not found:
        raise CaptureError(
            f"recording '{folder}': no image of cam1 has the time of one of cam0, to {SAME_MOMENT / 1e6:g} ms"
        )
    if len(found) < len(lefts):
        logger.warning(
            "recording '%s': %s have no right image of the same moment and are left out",
            *(folder, counted(len(lefts) - len(found), "left image")),
        )
    return found


def _eye(base: Path, name: str, size: tuple[int, int]) -> Eye:
    """Return the camera of a sensor.yaml, in the folder of its images or beside it."""
    path = base / name / "sensor.yaml"
    if not path.is_file() and (base / f"{name}_sensor.yaml").is_file():
        path = base / f"{name}_sensor.yaml"
    sensor = _sensor(path)
    model = sensor.text("camera_model", "pinhole")
    if model != "pinhole":
        raise CaptureError(f"'{path}': camera_model is '{model}', expected 'pinhole'")
    fx, fy, cx, cy = sensor.array("intrinsics", (4,)).tolist()
    k = Intrinsics(*size, fx, fy, cx + 0.5, cy + 0.5)
    resolution = sensor.array("resolution", (2,), default=np.array(size)).tolist()
    if tuple(resolution) != size:
        raise CaptureError(
            f"'{path}': resolution {resolution}, but the images have {size[0]}x{size[1]} pixels"
        )
    return Eye(k, _lens(sensor, path), _body_from(sensor, path))


def _lens(sensor: Fields, path: Path) -> Lens | None:
    model = sensor.text("distortion_model", "none").lower()
    found = sensor.array("distortion_coefficients", (-1,), default=np.zeros(4)).tolist()
    if model in FISHEYE_NAMES and len(found) <= 4:
        return Lens(tuple(found), is_fisheye=True)
    if model in BROWN_NAMES and len(found) <= 8:
        return Lens.brown(*found)
    raise CaptureError(
        f"'{path}': distortion_model '{model}' with {len(found)} coefficients, expected one of "
        f"{', '.join(BROWN_NAMES + FISHEYE_NAMES)} with up to 8 or, for fisheye lenses, 4"
    )


def _sensor(path: Path) -> Fields:
    content = read_yaml(path, "sensor file")
    return Fields(content, f"'{path}'", CaptureError)


def _body_from(sensor: Fields, path: Path) -> np.ndarray:
    """Return T_BS: body from sensor, (4, 4) [m]."""
    matrix = sensor.section("T_BS").array("data", (16,)).reshape(4, 4)
    return nearly_rigid(matrix, f"T_BS in '{path}'")


def _poses(base: Path, times: np.ndarray, body_from_cam: np.ndarray) -> list[np.ndarray | None]:
    """Return the pose of the camera at each time [ns]; None where none was measured."""
    truth = next((base / name for name in TRUTHS if (base / name / "data.csv").is_file()), None)
    if truth is None:
        return [None] * len(times)
    rows = _rows(truth / "data.csv")
    yaml = truth / "sensor.yaml"
    body_from_marker = _body_from(_sensor(yaml), yaml) if yaml.is_file() else np.eye(4)
    cam_in_marker = invert_rigid(body_from_marker) @ body_from_cam
    found = _interpolated(rows, times)
    if len(rows) and all(pose is None for pose in found):
        first, last, start, end = (
            float(t) / NANOSECONDS for t in (*rows[[0, -1], 0], times.min(), times.max())
        )
        raise CaptureError(
            f"'{truth / 'data.csv'}': poses from {first:.2f} to {last:.2f} s, but none at the times of the "
            f"images, {start:.2f} to {end:.2f} s; remove {truth.name} to go on without poses"
        )
    return [None if pose is None else pose @ cam_in_marker for pose in found]


def _rows(path: Path) -> np.ndarray:
    """Return time [ns], position [m] and quaternion wxyz of each line, (n, 8), in order of time."""
    lines = read_text(path, "ground truth").splitlines()
    with expecting(f"'{path}'", "lines of time, position and quaternion wxyz, separated by commas"):
        rows = [line.split(",")[:8] for line in lines if line[:1].isdigit()]
        found = np.array(rows, dtype=np.float64).reshape(-1, 8)
    found = found[np.isfinite(found).all(axis=1) & found[:, 4:].any(axis=1)]
    tracked = (found[:, 1:] != (0, 0, 0, 1, 0, 0, 0)).any(axis=1)
    found = found[tracked] if tracked.any() else found
    return found[np.argsort(found[:, 0], kind="stable")]


def _interpolated(rows: np.ndarray, times: np.ndarray) -> list[np.ndarray | None]:
    """Return world from marker at each time, between the measurements before and after it."""
    from scipy.spatial.transform import Rotation

    found: list[np.ndarray | None] = []
    for time in times:
        after = int(np.searchsorted(rows[:, 0], time))
        before = after - 1 if after == len(rows) or rows[after, 0] != time else after
        if (
            before < 0
            or after == len(rows)
            or rows[after, 0] - rows[before, 0] > LONGEST_GAP * NANOSECONDS
        ):
            found.append(None)
            continue
        (t0, *first), (t1, *second) = rows[before], rows[after]
        share = (time - t0) / (t1 - t0) if t1 > t0 else 0.0
        turns = [matrix_from_quat_xyzw(np.roll(row[3:], -1)) for row in (first, second)]
        step = Rotation.from_matrix(turns[0].T @ turns[1]).as_rotvec()
        turn = turns[0] @ Rotation.from_rotvec(share * step).as_matrix()
        found.append(rigid(turn, (1 - share) * np.array(first[:3]) + share * np.array(second[:3])))
    return found
