"""7-Scenes and its layout, and EuRoC's stereo pairs: through their lenses, with the poses of their body."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from digs_warp.check.check import check_capture
from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.images import write_image
from digs_warp.formats.captures.formats import read_recording
from digs_warp.formats.captures.seven_scenes import COLOR_FROM_DEPTH
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import invert_rigid, look_at, quat_xyzw_from_matrix, rigid
from digs_warp.poses.photo_matches import agreeing_shares
from reference.recorded import HEIGHT, WIDTH, check_same, converted


def write_frames(capture: Capture, folder: Path, unknown: int = 65535) -> None:
    """Millimetres, and another value than 0 for unknown depth; the numbers begin at 7 and have a gap."""
    for number, frame in zip((7, 8, 10), capture.frames, strict=True):
        start = folder / f"frame-{number:06d}"
        write_image(start.with_suffix(".color.png"), frame.load_image())
        depth = np.round(1000 * np.nan_to_num(frame.load_depth(), nan=unknown / 1000))
        write_image(start.with_suffix(".depth.png"), depth.astype(np.uint16))
        np.savetxt(start.with_suffix(".pose.txt"), frame.camera.world_from_cam, fmt="%.7e")


def calibrate(folder: Path) -> None:
    (folder / "camera-intrinsics.txt").write_text("19 0 8.75\n0 23 7.25\n0 0 1\n")


@pytest.fixture
def sequence(capture: Capture, tmp_path: Path) -> Path:
    write_frames(capture, tmp_path / "scene/seq-01")
    return tmp_path / "scene/seq-01"


def test_a_calibration_may_lie_beside_the_sequences(
    capture: Capture, sequence: Path, tmp_path: Path
) -> None:
    calibrate(sequence.parent)
    found = converted("7scenes", sequence, tmp_path / "capture")
    check_same(found, capture, 1e-3)
    assert [frame.time for frame in found.frames] == pytest.approx([0, 1 / 30, 3 / 30])


def test_an_info_file_has_the_cameras_of_color_and_depth_and_the_unit(
    capture: Capture, sequence: Path, tmp_path: Path
) -> None:
    for number, frame in zip((7, 8, 10), capture.frames, strict=True):
        depth = np.nan_to_num(frame.load_depth()).repeat(2, axis=0).repeat(2, axis=1)
        path = sequence / f"frame-{number:06d}.depth.png"
        write_image(path, np.round(5000 * depth).astype(np.uint16))
    (sequence / "_info.txt").write_text(
        "m_versionNumber = 4\nm_depthShift = 5000\n"
        "m_calibrationColorIntrinsic = 19 0 8.75 0 0 23 7.25 0 0 0 1 0 0 0 0 1\n"
        "m_calibrationDepthIntrinsic = 38 0 18 0 0 46 15 0 0 0 1 0 0 0 0 1\n"
    )
    check_same(converted("7scenes", sequence, tmp_path / "capture"), capture, 1e-3)
    (sequence / "info.txt").write_text("m_calibrationColorIntrinsic = 1 2 3\n")
    with pytest.raises(DigsError, match=r"info\.txt'.*4 x 4 numbers"):
        read_recording(sequence, "7scenes")


def test_the_kinect_of_7_scenes_has_its_color_camera_beside_the_depth_camera(
    tmp_path: Path,
) -> None:
    # A wall that the depth camera faces, 2 m away: from the color camera it is a little tilted.
    world_from_depth = look_at(
        np.array([1.0, 2.0, 0.5]), np.array([0.0, 2.0, 0.5]), np.array([0, 0, 1.0])
    )
    write_image(tmp_path / "frame-000000.color.png", np.full((480, 640, 3), 90, np.uint8))
    depth = np.full((480, 640), 2000, np.uint16)
    depth[200:300, 300:400] = 65535
    write_image(tmp_path / "frame-000000.depth.png", depth)
    np.savetxt(tmp_path / "frame-000000.pose.txt", world_from_depth)
    frame = converted("7scenes", tmp_path, tmp_path / "capture").frames[0]
    k = frame.camera.intrinsics
    assert k == Intrinsics(640, 480, 525.0, 525.0, 320.5, 240.5)
    np.testing.assert_allclose(
        frame.camera.world_from_cam, world_from_depth @ invert_rigid(COLOR_FROM_DEPTH), atol=1e-12
    )
    found = frame.load_depth()
    seen = np.isfinite(found)
    rows, columns = np.nonzero(seen)
    points = frame.camera.unproject(np.stack([columns + 0.5, rows + 0.5], axis=1), found[seen])
    np.testing.assert_allclose(points[:, 0], 1.0 - 2.0, atol=2e-3)  # all on the wall
    # The hole is where the color camera sees it, 2.6 cm further left.
    hole = np.argwhere(~seen[100:380, 150:500]) + [100, 150]
    depth_camera = Camera(Intrinsics(640, 480, 585.0, 585.0, 320.5, 240.5), world_from_depth)
    corner = depth_camera.unproject(np.array([[300.0, 200.0]]), np.array([2.0]))
    expected, _ = frame.camera.project(corner)
    np.testing.assert_allclose(hole.min(axis=0)[::-1], expected[0], atol=1.5)


def spoil(name: str, content: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_text(content)


SPOILED: dict[str, tuple[Callable[[Path], object], str]] = {
    "pose of three rows": (spoil("frame-000008.pose.txt", "1 0 0 0\n" * 3), "000008.pose.txt.*16|4, 4"),
    "pose with words": (spoil("frame-000008.pose.txt", "lost " * 16), "frame-000008.pose.txt"),
    "pose that scales": (
        spoil("frame-000008.pose.txt", "2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1"), "no rotation"
    ),
    "calibration": (spoil("camera-intrinsics.txt", "19 8.75\n"), "camera-intrinsics.txt"),
    "negative": (spoil("camera-intrinsics.txt", "-19 0 8 0 23 7 0 0 1\n"), "focal lengths above 0"),
    "depth": (spoil("frame-000008.depth.png", "no image"), "000008.depth.png"),
}  # fmt: skip


@pytest.mark.parametrize("name", SPOILED)
def test_broken_sequences_are_explained(sequence: Path, tmp_path: Path, name: str) -> None:
    calibrate(sequence)
    change, message = SPOILED[name]
    change(sequence)
    with pytest.raises(DigsError, match=message):
        converted("7scenes", sequence, tmp_path / "capture")


def test_other_cameras_need_a_calibration_and_a_scene_has_sequences(sequence: Path) -> None:
    with pytest.raises(
        DigsError, match=rf"images of {WIDTH}x{HEIGHT} pixels and no camera-intrinsics"
    ):
        read_recording(sequence, "7scenes")
    with pytest.raises(DigsError, match="name one of its sequences: seq-01"):
        read_recording(sequence.parent, "7scenes")


SIZE = WIDE, HIGH = 120, 80
K = np.array([[[90, 0, 60.2], [0, 92, 41], [0, 0, 1]], [[88, 0, 58], [0, 91, 38.5], [0, 0, 1]]])
RADIAL, FISHEYE = "radial-tangential", "equidistant"
LENSES = {RADIAL: np.array([-0.28, 0.07, 2e-4, 2e-5]), FISHEYE: np.array([0.01, -0.005, 1e-3, 0])}
TIMES = [1_403_715_273_262_142_976 + 50_000_000 * n for n in range(3)]  # [ns]
TRUTH = "state_groundtruth_estimate0/data.csv"


def placed(x: float, y: float, z: float, *degrees: float) -> np.ndarray:
    return rigid(Rotation.from_euler("xyz", degrees, degrees=True).as_matrix(), np.array([x, y, z]))


# In the body's axes the cameras look along x, as in a drone.
PLACES = [placed(0.02, 0.05, 0, 1, -2, 1.5), placed(0.01, -0.06, 0.005, -1, 1, -1)]
EYES = [place @ rigid(np.eye(3)[[1, 2, 0]].T * [-1, -1, 1], np.zeros(3)) for place in PLACES]


def world_from_body(time: float) -> np.ndarray:
    return placed(2e-9 * (time - TIMES[0]), 0.2, 1, 0, 0, 8e-8 * (time - TIMES[0]))


def wall(origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """The brightness of a wall at x = 2: soft waves, so that a pixel's place can be measured."""
    _, y, z = np.moveaxis(origin + rays * ((2 - origin[0]) / rays[..., :1]), -1, 0)
    return 120 + 50 * np.sin(14 * y + 3 * z) + 50 * np.sin(11 * z - 2 * y)


def write_euroc(folder: Path, model: str = RADIAL) -> Path:
    """Write the wall through the lenses; with those of fisheyes, times are in seconds."""
    stamp = str if model == RADIAL else lambda time: f"{time / 1e9:.7f}"
    undo = cv2.undistortPoints if model == RADIAL else cv2.fisheye.undistortPoints
    for eye in (0, 1):
        flat = undo(pixel_centers(*SIZE).reshape(-1, 1, 2) - 0.5, K[eye], LENSES[model])
        rays = np.dstack([flat.reshape(HIGH, WIDE, 2), np.ones((HIGH, WIDE))])
        for time in TIMES:
            pose = world_from_body(time) @ EYES[eye]
            pixels = wall(pose[:3, 3], rays @ pose[:3, :3].T).astype(np.uint8)[..., None]
            write_image(folder / f"mav0/cam{eye}/data/{stamp(time)}.png", pixels)
        (folder / f"mav0/cam{eye}/sensor.yaml").write_text(
            f"%YAML:1.0\nT_BS:\n  cols: 4\n  data: {EYES[eye].ravel().tolist()}\nresolution: {list(SIZE)}\n"
            f"intrinsics: {K[eye][[0, 1, 0, 1], [0, 1, 2, 2]].tolist()} #fu, fv, cu, cv\n"
            f"distortion_model: {model}\ndistortion_coefficients: {LENSES[model].tolist()}\n"
        )
    lines = ["#timestamp, p_RS_R_x [m], ..."]
    for time in (time + shift for time in TIMES for shift in (3_000_000, -7_000_000)):
        pose = world_from_body(time)
        place = [*pose[:3, 3], *np.roll(quat_xyzw_from_matrix(pose[:3, :3]), 1), 0, 0, 0]
        lines.append(",".join([stamp(time), *map(str, place)]))
    (folder / "mav0" / TRUTH).parent.mkdir()
    (folder / "mav0" / TRUTH).write_text("\n ".join(lines).replace(",", ", ") + "\n")
    return folder


@pytest.mark.parametrize("model", LENSES)
def test_both_images_are_those_of_rectified_cameras(tmp_path: Path, model: str) -> None:
    found = converted("euroc", write_euroc(tmp_path / "euroc", model), tmp_path / "capture")
    assert len(found) == 3 and found.knows_poses and found.rig is not None
    for frame in found.frames:
        right = frame.camera.shifted_right(found.rig.baseline)
        images = frame.load_image(), frame.load_right_image()
        for camera, eye, pixels in zip((frame.camera, right), EYES, images, strict=True):
            place = (world_from_body(TIMES[0] + 1e9 * frame.time) @ eye)[:3, 3]
            np.testing.assert_allclose(camera.center_world, place, atol=2e-6)
            far = camera.unproject(pixel_centers(*SIZE), np.ones((HIGH, WIDE)))
            away = (pixels[..., 0] - wall(place, far - place))[8:-8, 8:-8]
            # Half a pixel would show by up to 4 in the steepest places.
            assert abs(away.mean()) < 0.9 and np.abs(away).mean() < 1.2


def test_what_has_no_partner_no_pose_or_no_right_eye(tmp_path: Path) -> None:
    base = write_euroc(tmp_path / "euroc") / "mav0"
    (base / f"cam1/data/{TIMES[0]}.png").unlink()
    (base / TRUTH).write_text("\n".join((base / TRUTH).read_text().splitlines()[5:]))
    recording = read_recording(base.parent, "euroc")
    assert [frame.world_from_cam is None for frame in recording.frames] == [True, False]
    assert "a left image has no right one of its moment, and is left out" in recording.notes
    (base / "cam1").rename(base / "other")
    (base / TRUTH).unlink()
    alone = converted("euroc", base, tmp_path / "capture")
    assert len(alone) == 3 and alone.rig is None and not alone.knows_poses


def test_broken_stereo_is_explained(tmp_path: Path) -> None:
    base = write_euroc(tmp_path) / "mav0"
    for name, old, new, message in (
        ("cam1/sensor.yaml", RADIAL, "mirror", "distortion_model 'mirror'"),
        ("cam1/sensor.yaml", ", -0.06", ", 0.06", "expected a left and a right eye"),
        (TRUTH, "0.2", "here", "lines of time, position and quatern"),
    ):
        text = (base / name).read_text()
        (base / name).write_text(text.replace(old, new))
        with pytest.raises(DigsError, match=message):
            read_recording(tmp_path, "euroc")
        (base / name).write_text(text)


def room(origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """The brightness of a wall at x = 2 and a board before it, of fine texture."""
    texture = np.random.default_rng(0).integers(10, 240, (400, 400)).astype(np.float32)
    texture = cv2.GaussianBlur(texture, (0, 0), 0.7)
    shown = np.zeros(rays.shape[:2], np.float32)
    for x, right, left in ((2.0, -9.0, 9.0), (1.5, 0.0, 0.5)):
        _, y, z = np.moveaxis(origin + rays * ((x - origin[0]) / rays[..., :1]), -1, 0)
        across, up = (((60 * each + 180) % 399).astype(np.float32) for each in (y + x / 3, z))
        seen = cv2.remap(texture, across, up, cv2.INTER_LINEAR)
        shown = np.where((y > right) & (y < left), seen, shown)
    return shown


def test_poses_lenses_and_matched_depth_of_a_moving_sequence_agree(
    tmp_path: Path, monkeypatch
) -> None:
    large = {"WIDE": 360, "HIGH": 240, "SIZE": (360, 240), "K": K * np.array([[3], [3], [1]])}
    times = [TIMES[0] + 50_000_000 * n for n in range(12)]

    def walk(time: float) -> np.ndarray:
        gone = time - TIMES[0]
        return placed(4e-10 * gone, 0.5 - 1.2e-9 * gone, 1, 0, 0, 3e-8 * gone)

    changed = large | {"TIMES": times, "wall": room, "world_from_body": walk}
    for name, value in changed.items():
        monkeypatch.setitem(globals(), name, value)
    folder = write_euroc(tmp_path / "euroc")
    capture = converted("euroc", folder, tmp_path / "capture")
    found = check_capture(capture)
    assert found.findings == () and found.agreement is not None
    assert found.agreement.depth > 0.9 and found.agreement.brightness > 0.9
    assert min(filter(None, agreeing_shares(capture.frames))) > 0.9
    for eye, place in enumerate(EYES):  # both look elsewhere in the body
        sensor = folder / f"mav0/cam{eye}/sensor.yaml"
        turned = place @ placed(0, 0, 0, 0, 15, 0)
        old, new = (str(each.ravel().tolist()) for each in (place, turned))
        sensor.write_text(sensor.read_text().replace(old, new))
    wrong = converted("euroc", folder, tmp_path / "wrong")
    apart = check_capture(wrong).agreement
    assert apart is not None and apart.depth < 0.85
