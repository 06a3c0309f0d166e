"""EuRoC MAV, and data sets in its layout (ASL): a stereo camera through its lenses, poses of its body.

docs/recordings.md has the layout. T_BS is body from camera; state_groundtruth_estimate0 has time, position,
quaternion wxyz: world from body; vicon0 and mocap0 the same of a marker, whose sensor.yaml has its T_BS. The
images are rectified: rows in common, the left eye as the frame's camera. See
https://projects.asl.ethz.ch/datasets/doku.php?id=kmavvisualinertialdatasets.
"""

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.images import image_size
from digs_warp.formats.captures.frames import integer_centered
from digs_warp.formats.captures.lens import Lens, PinholeView
from digs_warp.formats.captures.recording import (
    IMAGE_SUFFIXES,
    RecordedFrame,
    Recording,
    expecting,
    in_seconds,
)
from digs_warp.formats.captures.to_capture import nearly_rigid
from digs_warp.formats.captures.tum import at_the_moments
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import invert_rigid, rigid
from digs_warp.record.fields import Fields
from digs_warp.record.files import read_text, read_yaml
from digs_warp.words import counted

# A time as a name: nanoseconds have 19 digits.
STAMP = re.compile(r"\d{1,19}(\.\d{1,19})?")

# Left and right images further apart in time [s] were not taken together.
LARGEST_DELAY = 1e-3
LEFT_OUT = "a left image has no right one of its moment, and is left out"

# Poses further in time from the next measurement [s] are unknown.
NEAREST_POSE = 0.05

# Eyes that look further apart [cosine] are no stereo pair.
LEAST_COSINE = 0.9

TRUTHS = ("state_groundtruth_estimate0", "vicon0", "mocap0")
FISHEYE_NAMES = ("equidistant", "kannala-brandt", "kannala_brandt", "fisheye", "opencv_fisheye")
BROWN_NAMES = ("radial-tangential", "radtan", "plumb_bob", "brown", "none")


def read_euroc(folder: Path) -> Recording:
    """Read a sequence: the folder with mav0, or mav0 itself. Without cam1, its left images alone."""
    base = folder / "mav0" if (folder / "mav0").is_dir() else folder
    times, images = _images(base, "cam0")
    if not images:
        raise CaptureError(
            f"recording '{folder}': no images mav0/cam0/data/TIME.png; is this the right --from?"
        )
    view, body_from_cam = _eye(base, "cam0", images[0])
    right_times, rights = _images(base, "cam1")
    partners: list[int | None] = [None] * len(images)
    baseline, right_view, notes = None, None, Counter()
    if rights:
        partners = at_the_moments(times, right_times, base / "cam1", "right image", LARGEST_DELAY)
        notes[LEFT_OUT] = partners.count(None)
        right = _eye(base, "cam1", rights[0])
        view, right_view, baseline, turned = _rectified(
            folder, view, right[0], invert_rigid(body_from_cam) @ right[1]
        )
        body_from_cam = body_from_cam @ turned
    poses = _poses(base, times, body_from_cam)
    frames = tuple(
        RecordedFrame(
            images[i], view.target, float(times[i]), poses[i], view=view, right_view=right_view,
            right=None if partner is None else rights[partner],
        )
        for i, partner in enumerate(partners)
        if partner is not None or not rights
    )  # fmt: skip
    return Recording(folder, frames, baseline=baseline, notes=+notes)


def _images(base: Path, eye: str) -> tuple[np.ndarray, list[Path]]:
    """Return times [s], ascending, and images of an eye."""
    files = [*(base / eye).glob("data/*"), *(base / eye).glob("*")]
    found = [f for f in files if f.suffix.lower() in IMAGE_SUFFIXES and STAMP.fullmatch(f.stem)]
    times = in_seconds([float(path.stem) for path in found], Counter())
    order = np.argsort(times)
    return times[order], [found[i] for i in order]


def _eye(base: Path, name: str, image: Path) -> tuple[PinholeView, np.ndarray]:
    """Return the view and T_BS (body from camera) from an eye's sensor.yaml."""
    places = (base / name / "sensor.yaml", base / f"{name}_sensor.yaml")
    path = next(filter(Path.is_file, places), places[0])
    sensor = _sensor(path)
    if (model := sensor.text("camera_model", "pinhole")) != "pinhole":
        raise CaptureError(f"'{path}': camera_model is '{model}', expected 'pinhole'")
    fx, fy, cx, cy = sensor.array("intrinsics", (4,)).tolist()
    width, height = sensor.array("resolution", (2,), default=np.array(image_size(image)))
    k = Intrinsics(int(width), int(height), fx, fy, cx + 0.5, cy + 0.5)
    return PinholeView(k, _lens(sensor, path), k), _body_from(sensor, path)


def _lens(sensor: Fields, path: Path) -> Lens:
    model = sensor.text("distortion_model", "none").lower()
    found = tuple(sensor.array("distortion_coefficients", (-1,), default=np.zeros(4)).tolist())
    is_fisheye = model in FISHEYE_NAMES
    if not (is_fisheye or model in BROWN_NAMES) or len(found) > (4 if is_fisheye else 8):
        raise CaptureError(
            f"'{path}': distortion_model '{model}' with {len(found)} coefficients, expected one of "
            f"{', '.join(BROWN_NAMES + FISHEYE_NAMES)} with up to 8 or, for fisheye lenses, 4"
        )
    return Lens(found, is_fisheye)


def _sensor(path: Path) -> Fields:
    return Fields(read_yaml(path, "sensor file"), f"'{path}'", CaptureError)


def _body_from(sensor: Fields, path: Path) -> np.ndarray:
    """Return T_BS: body from sensor, (4, 4) [m]."""
    matrix = sensor.section("T_BS").array("data", (16,)).reshape(4, 4)
    return nearly_rigid(matrix, f"T_BS in '{path}'")


def _rectified(
    folder: Path, left: PinholeView, right: PinholeView, left_from_right: np.ndarray
) -> tuple[PinholeView, PinholeView, float, np.ndarray]:
    """Return views of the rectified eyes, baseline [m], and left from rectified left camera, (4, 4).

    OpenCV sees the eyes without their lenses, so that the smaller of their focal lengths stays.
    """
    import cv2

    x, y, z = left_from_right[:3, 3].tolist()
    cosine = left_from_right[2, 2]
    if not (x > max(abs(y), abs(z)) and cosine > LEAST_COSINE):
        raise CaptureError(
            f"recording '{folder}': cam1 is {x:.3g} m to the right of cam0, {y:.3g} below and {z:.3g} ahead, "
            f"their views have the cosine {cosine:.2f}; expected a left and a right eye, almost parallel: "
            "check T_BS, or swap the folders"
        )
    motion = invert_rigid(left_from_right)
    size = left.source.width, left.source.height
    eyes = [(integer_centered(eye.source).matrix, np.zeros(4)) for eye in (left, right)]
    turns = cv2.stereoRectify(*eyes[0], *eyes[1], size, motion[:3, :3], motion[:3, 3:])
    target = Intrinsics.from_matrix(turns[2], *size, first_center=0)
    views = [
        replace(eye, target=target, rotation=tuple(turn.ravel().tolist()))
        for eye, turn in zip((left, right), turns[:2], strict=True)
    ]
    baseline = float(np.linalg.norm(motion[:3, 3]))
    return views[0], views[1], baseline, rigid(turns[0].T, np.zeros(3))


def _poses(base: Path, times: np.ndarray, body_from_cam: np.ndarray) -> list[np.ndarray | None]:
    """Return the pose of the camera at each time [s], between measurements; None: none is near."""
    from scipy.spatial.transform import Rotation, Slerp

    truth = next((base / name for name in TRUTHS if (base / name / "data.csv").is_file()), None)
    if truth is None:
        return [None] * len(times)
    path, yaml = truth / "data.csv", truth / "sensor.yaml"
    rows = _rows(path)
    moments = rows[:, 0]
    near = at_the_moments(times, moments, path, "pose", NEAREST_POSE)
    inside = times.clip(moments[0], moments[-1])
    body_from_marker = _body_from(_sensor(yaml), yaml) if yaml.is_file() else np.eye(4)
    marker_from_cam = invert_rigid(body_from_marker) @ body_from_cam
    turns = Slerp(moments, Rotation.from_quat(np.roll(rows[:, 4:], -1, axis=1)))(inside).as_matrix()
    places = np.stack([np.interp(inside, moments, rows[:, axis]) for axis in (1, 2, 3)], axis=1)
    return [
        rigid(turns[i], places[i]) @ marker_from_cam if known else None
        for i, known in enumerate(
            (abs(times - inside) <= LARGEST_DELAY) & [n is not None for n in near]
        )
    ]


def _rows(path: Path) -> np.ndarray:
    """Return time [s], ascending, position [m] and quaternion wxyz of each measurement, (n, 8)."""
    lines = read_text(path, "ground truth").splitlines()
    with expecting(f"'{path}'", "lines of time, position and quaternion wxyz, separated by commas"):
        rows = [line.split(",")[:8] for line in lines if line.lstrip()[:1].isdigit()]
        found = np.array(rows, dtype=np.float64).reshape(-1, 8)
    found = found[np.isfinite(found).all(axis=1) & found[:, 4:].any(axis=1)]
    found[:, 0] = in_seconds(found[:, 0], Counter())
    found = found[np.unique(found[:, 0], return_index=True)[1]]
    if len(found) < 2:
        raise CaptureError(
            f"'{path}': {counted(len(found), 'pose')}, expected two or more; remove {path.parent.name} to go "
            "on without poses"
        )
    return found
