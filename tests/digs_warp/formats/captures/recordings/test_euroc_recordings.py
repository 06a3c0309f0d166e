"""EuRoC's stereo pairs: through their lenses, turned against each other, with the poses of their body."""

import logging
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.images import write_image
from digs_warp.formats.captures.formats import read_recording
from digs_warp.formats.captures.lens import Lens
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import quat_xyzw_from_matrix, rigid
from reference.recorded import converted

SIZE = WIDTH, HEIGHT = 120, 80
K = [np.array([90.0, 92.0, 60.2, 41.0]), np.array([88.0, 91.0, 58.0, 38.5])]  # centers at integers
LENSES = {
    "radial-tangential": [(-0.28, 0.07, 0.0002, 0.00002), (-0.27, 0.08, -0.0001, -0.00004)],
    "equidistant": [(0.01, -0.005, 0.001, 0.0), (0.012, -0.004, 0.0, 0.0)],
}
TIMES = [1_403_715_273_262_142_976 + 50_000_000 * n for n in range(3)]


def turn(*degrees: float) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", degrees, degrees=True).as_matrix()


# In the body's axes the cameras look along x, as in a drone.
FORWARD = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
EYES = [
    rigid(FORWARD @ turn(1, -2, 1.5), np.array([0.02, 0.05, 0.0])),
    rigid(FORWARD @ turn(-1, 1, -1), np.array([0.01, -0.06, 0.005])),
]
WORLD_FROM_BODY = [rigid(turn(0, 0, 4 * n), np.array([0.1 * n, 0.2, 1.0])) for n in range(3)]


def wall(points: np.ndarray) -> np.ndarray:
    """The brightness of a wall at x = 2: soft waves, so that a pixel's place can be measured."""
    y, z = points[..., 1], points[..., 2]
    return 120 + 50 * np.sin(14 * y + 3 * z) + 50 * np.sin(11 * z - 2 * y)


def image(eye: int, model: str, world_from_body: np.ndarray) -> np.ndarray:
    """What an eye sees of the wall through its lens: the ray of each pixel is sought by iteration."""
    fx, fy, cx, cy = K[eye]
    lens = Lens(LENSES[model][eye], is_fisheye=model == "equidistant")
    target = (pixel_centers(WIDTH, HEIGHT) - 0.5 - [cx, cy]) / [fx, fy]
    flat = target.copy()
    for _ in range(50):
        flat -= lens.distort(np.dstack([flat, np.ones(flat.shape[:2])])) - target
    pose = world_from_body @ EYES[eye]
    rays = np.dstack([flat, np.ones(flat.shape[:2])]) @ pose[:3, :3].T
    hits = pose[:3, 3] + rays * ((2 - pose[0, 3]) / rays[..., :1])
    return np.repeat(wall(hits).astype(np.uint8)[..., None], 3, axis=2)


def sensor_yaml(eye: int, model: str) -> str:
    numbers = ", ".join(map(repr, EYES[eye].ravel().tolist()))
    coefficients = list(LENSES[model][eye])
    return (
        "%YAML:1.0\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n"
        f"  data: [{numbers}]\nrate_hz: 20\nresolution: [{WIDTH}, {HEIGHT}]\ncamera_model: pinhole\n"
        f"intrinsics: {K[eye].tolist()} #fu, fv, cu, cv\n"
        f"distortion_model: {model}\ndistortion_coefficients: {coefficients}\n"
    )


def write_euroc(folder: Path, model: str = "radial-tangential") -> Path:
    base = folder / "mav0"
    for eye in (0, 1):
        for time, pose in zip(TIMES, WORLD_FROM_BODY, strict=True):
            write_image(base / f"cam{eye}/data/{time}.png", image(eye, model, pose)[..., :1])
        (base / f"cam{eye}/sensor.yaml").write_text(sensor_yaml(eye, model))
    lines = ["#timestamp, p_RS_R_x [m], ..."]
    for time, pose in zip(TIMES, WORLD_FROM_BODY, strict=True):
        x, y, z, w = quat_xyzw_from_matrix(pose[:3, :3])
        position = pose[:3, 3].tolist()
        for shift in (-3_000_000, 3_000_000):  # measured before and after the image
            lines.append(f"{time + shift},{','.join(map(str, [*position, w, x, y, z]))},0,0,0")
    truth = base / "state_groundtruth_estimate0"
    truth.mkdir()
    (truth / "data.csv").write_text("\n".join([lines[0], *lines[:0:-1]]) + "\n")
    return folder


@pytest.fixture(scope="module", params=list(LENSES))
def sequence(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_euroc(tmp_path_factory.mktemp("euroc") / request.param, request.param)


def test_both_images_are_those_of_rectified_pinhole_cameras(sequence: Path, tmp_path: Path) -> None:
    found = converted("euroc", sequence, tmp_path / "capture")
    assert len(found) == 3 and found.knows_poses and found.rig is not None
    apart = np.linalg.norm(EYES[1][:3, 3] - EYES[0][:3, 3])
    assert found.rig.baseline == pytest.approx(float(apart))
    assert [frame.time for frame in found.frames] == pytest.approx([0, 0.05, 0.1], abs=1e-6)
    for frame, pose in zip(found.frames, WORLD_FROM_BODY, strict=True):
        np.testing.assert_allclose(frame.camera.center_world, (pose @ EYES[0])[:3, 3], atol=1e-6)
        right = frame.camera.shifted_right(found.rig.baseline)
        np.testing.assert_allclose(right.center_world, (pose @ EYES[1])[:3, 3], atol=1e-6)
        for camera, pixels in (
            (frame.camera, frame.load_image()),
            (right, frame.load_right_image()),
        ):
            difference = pixels[8:-8, 8:-8, 0] - expected(camera)[8:-8, 8:-8]
            # Half a pixel would show by up to 4 in the steepest places.
            assert abs(difference.mean()) < 0.9 and np.abs(difference).mean() < 1.2


def expected(camera: Camera) -> np.ndarray:
    k = camera.intrinsics
    far = camera.unproject(pixel_centers(k.width, k.height), np.ones((k.height, k.width)))
    rays = far - camera.center_world
    return wall(camera.center_world + rays * ((2 - camera.center_world[0]) / rays[..., :1]))


def test_a_sequence_without_ground_truth_or_without_a_right_eye(tmp_path: Path) -> None:
    folder = write_euroc(tmp_path / "euroc")
    (folder / "mav0/state_groundtruth_estimate0/data.csv").unlink()
    assert not read_recording(folder, "euroc").knows_poses
    for path in folder.glob("mav0/cam1/data/*"):
        path.unlink()
    alone = converted("euroc", folder / "mav0", tmp_path / "capture")
    assert alone.rig is None and len(alone) == 3
    assert alone.frames[0].camera.intrinsics == Intrinsics(WIDTH, HEIGHT, 90, 92, 60.7, 41.5)


def test_images_without_a_partner_or_a_pose_are_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = write_euroc(tmp_path / "euroc")
    (folder / f"mav0/cam1/data/{TIMES[0]}.png").unlink()
    path = folder / "mav0/state_groundtruth_estimate0/data.csv"
    path.write_text("\n".join(path.read_text().splitlines()[:3]) + "\n")  # of the last moment
    with caplog.at_level(logging.WARNING):
        assert len(converted("euroc", folder, tmp_path / "capture")) == 1
    assert "1 left image have no right image" in caplog.text
    assert "1 of 2 frames have no pose" in caplog.text


def edit(name: str, old: str, new: str) -> Callable[[Path], object]:
    def change(folder: Path) -> None:
        path = folder / "mav0" / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))

    return change


BROKEN: dict[str, tuple[Callable[[Path], object], str]] = {
    "no sensor": (lambda folder: (folder / "mav0/cam0/sensor.yaml").unlink(), "cam0/sensor.yaml.*no such"),
    "no yaml": (edit("cam0/sensor.yaml", "T_BS:", "T_BS: ["), "not readable as YAML"),
    "no camera": (edit("cam0/sensor.yaml", "intrinsics:", "numbers:"), "intrinsics"),
    "other lens": (edit("cam1/sensor.yaml", "radial-tangential", "mirror"), "distortion_model 'mirror'"),
    "other size": (edit("cam1/sensor.yaml", "[120, 80]", "[640, 480]"), "the images have 120x80"),
    "swapped": (
        lambda folder: (
            (folder / "mav0/cam0").rename(folder / "mav0/other"),
            (folder / "mav0/cam1").rename(folder / "mav0/cam0"),
            (folder / "mav0/other").rename(folder / "mav0/cam1"),
        ),
        "cam1 is not to the right of cam0",
    ),
    "one place": (
        lambda folder: (folder / "mav0/cam1/sensor.yaml").write_text(sensor_yaml(0, "radial-tangential")),
        "the two cameras are 0 m apart",
    ),
    "truth": (
        edit("state_groundtruth_estimate0/data.csv", "0.2", "here"), "lines of time, position and quatern"
    ),
    "other clock": (
        lambda folder: (folder / "mav0/state_groundtruth_estimate0/data.csv").write_text(
            "#time\n1000000000,0,0,0,1,0,0,0\n2000000000,0,0,0,1,0,0,0\n"
        ),
        r"poses from 1\.00 to 2\.00 s, but none at the times of the images",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_broken_sequences_are_explained(tmp_path: Path, name: str) -> None:
    folder = write_euroc(tmp_path / "euroc")
    change, message = BROKEN[name]
    change(folder)
    with pytest.raises(DigsError, match=message):
        read_recording(folder, "euroc")


def test_a_real_pair_has_its_points_on_the_same_rows(sample_data: Path, tmp_path: Path) -> None:
    cv2: Any = import_module("cv2")  # its stubs have no SIFT
    frame = converted("euroc", sample_data / "rgbd/euroc_static_stereo", tmp_path).frames[0]
    left, right = frame.load_image()[..., 0], frame.load_right_image()[..., 0]
    finder = cv2.SIFT_create(800)
    (here, features), (there, others) = (
        finder.detectAndCompute(eye, np.full(eye.shape, 255, np.uint8)) for eye in (left, right)
    )
    pairs = cv2.BFMatcher(crossCheck=True).match(features, others)
    close = sorted(pairs, key=lambda pair: pair.distance)[:150]
    rows = [here[p.queryIdx].pt[1] - there[p.trainIdx].pt[1] for p in close]
    shifts = [here[p.queryIdx].pt[0] - there[p.trainIdx].pt[0] for p in close]
    assert np.median(np.abs(rows)) < 0.4 and np.median(shifts) > 5
