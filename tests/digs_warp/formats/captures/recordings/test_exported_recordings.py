"""What our exporters write comes back, broken files are named, and films become sharp frames."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.cli import main
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.layers import Layer
from digs_warp.data.sharpness import REPEATED, Sharpness
from digs_warp.formats.captures.formats import READERS, export_capture, read_recording
from digs_warp.formats.captures.video import choose
from digs_warp.geometry.camera import Camera
from digs_warp.show.film.video import write_video
from reference import realsense_bag
from reference.recorded import check_same, converted


@pytest.mark.parametrize(
    ("form", "tolerance"), [("tum", 2e-4), ("redwood", 1e-3), ("bop", 2e-4), ("nerfstudio", 1e-3)]
)
def test_exports_come_back_as_the_same_points(
    capture: Capture, form: str, tolerance: float, tmp_path: Path
) -> None:
    export_capture(capture, form, tmp_path / form)
    found = converted(form, tmp_path / form, tmp_path / "capture")
    check_same(found, capture, tolerance)
    assert found.knows_poses


def test_masks_and_cameras_of_bop_come_back(capture: Capture, tmp_path: Path) -> None:
    zoomed = replace(capture.frames[2].camera.intrinsics, fx=30.0)
    last = replace(
        capture.frames[2], camera=Camera(zoomed, capture.frames[2].camera.world_from_cam)
    )
    export_capture(replace(capture, frames=(*capture.frames[:2], last)), "bop", tmp_path / "bop")
    found = converted("bop", tmp_path / "bop", tmp_path / "capture")
    assert [frame.camera.intrinsics.fx for frame in found.frames] == [19.0, 19.0, 30.0]
    mask, true = [each.frames[1].load_mask() > 127 for each in (found, capture)]
    np.testing.assert_array_equal(mask, true)


@pytest.mark.parametrize("form", READERS)
def test_an_empty_folder_is_no_recording(form: str, tmp_path: Path) -> None:
    with pytest.raises(DigsError, match=str(tmp_path)):
        read_recording(tmp_path, form)
    with pytest.raises(CaptureError, match="no such folder"):
        read_recording(tmp_path / "missing", form)
    (tmp_path / "walk.mp4").write_bytes(b"film")
    with pytest.raises(CaptureError, match=r"expected a folder, found a file.*--from video"):
        read_recording(tmp_path / "walk.mp4", form)


def test_tum_needs_to_know_its_camera(capture: Capture, tmp_path: Path) -> None:
    export_capture(capture, "tum", tmp_path / "rgbd_dataset_freiburg2_desk")
    (tmp_path / "rgbd_dataset_freiburg2_desk/calibration.txt").unlink()
    recording = read_recording(tmp_path / "rgbd_dataset_freiburg2_desk", "tum")
    assert recording.frames[0].intrinsics.fx == 520.9
    (tmp_path / "rgbd_dataset_freiburg2_desk").rename(tmp_path / "mine")
    with pytest.raises(CaptureError, match=r"write 'fx fy cx cy' into its calibration\.txt"):
        read_recording(tmp_path / "mine", "tum")


@pytest.mark.parametrize("name", ["depth.txt", "groundtruth.txt"])
def test_tum_times_that_match_nothing_are_an_error(
    capture: Capture, tmp_path: Path, name: str
) -> None:
    export_capture(capture, "tum", tmp_path / "tum")
    shift_times(tmp_path / "tum" / name, 3600.0)
    with pytest.raises(CaptureError, match=rf"{name}': none of 3 .* nearest are 3.6e\+03 s away"):
        read_recording(tmp_path / "tum", "tum")


def test_tum_images_without_depth_are_counted(capture: Capture, tmp_path: Path, caplog) -> None:
    export_capture(capture, "tum", tmp_path / "tum")
    path = tmp_path / "tum/depth.txt"
    path.write_text("\n".join(path.read_text().splitlines()[:-1]))
    found = converted("tum", tmp_path / "tum", tmp_path / "capture")
    assert [frame.has(Layer.DEPTH) for frame in found.frames] == [True, True, False]
    assert "1 of 3 images have no depth of the same moment, to 20 ms" in caplog.text


def shift_times(path: Path, seconds: float) -> None:
    lines = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    moved = [" ".join([f"{float(time) + seconds:.6f}", *rest]) for time, *rest in lines]
    path.write_text("\n".join(moved))


@pytest.mark.parametrize(
    ("form", "name", "content", "message"),
    [
        ("tum", "rgb.txt", "no numbers here\n", "lines of time and file name"),
        ("tum", "groundtruth.txt", "1 2 3\n", "poses"),
        ("redwood", "camera_intrinsic.json", "{}", "intrinsic_matrix"),
        ("redwood", "trajectory.log", "0 0 1\n1 0 0\n", "trajectory"),
        ("bop", "train/000000/scene_camera.json", "{}", "has no '0'"),
    ],
)
def test_broken_files_are_named(
    capture: Capture, tmp_path: Path, form: str, name: str, content: str, message: str
) -> None:
    export_capture(capture, form, tmp_path)
    (tmp_path / name).write_text(content)
    with pytest.raises(DigsError, match=message):
        read_recording(tmp_path, form)


FILM_WIDTH, FILM_HEIGHT = 160, 120


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walk along a wall; all but every fifth frame are blurred, and one is repeated."""
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(
        rng.integers(0, 255, (FILM_HEIGHT, 600, 3), dtype=np.uint8), (0, 0), 1.2
    )
    frames = [np.ascontiguousarray(wall[:, 6 * n : 6 * n + FILM_WIDTH]) for n in range(60)]
    frames = [f if n % 5 == 2 else cv2.GaussianBlur(f, (0, 0), 2) for n, f in enumerate(frames)]
    path = tmp_path_factory.mktemp("film") / "walk.mp4"
    write_video(path, [*frames[:30], frames[29], *frames[30:]], 30)
    return path


def convert(film: Path, out: Path, *more: str) -> int:
    return main(["convert", str(film), "--from", "video", "--out", str(out), *more])


def test_the_sharp_frames_of_a_film_become_a_capture_without_poses(
    film: Path, tmp_path: Path, capsys
) -> None:
    assert convert(film, tmp_path / "c", "--frames", "12", "--fov-deg", "70") == 0
    assert "poses unknown: 'reconstruct --poses sfm' finds them" in capsys.readouterr().out
    found = read_capture(tmp_path / "c")
    assert not found.knows_poses and len(found) == 12
    k = found.frames[0].camera.intrinsics
    assert k.fx == pytest.approx(FILM_WIDTH / 2 / np.tan(np.deg2rad(35)))
    gaps = np.diff([frame.time for frame in found.frames])
    assert 0.5 / 6 < gaps.min() and gaps.max() < 2 / 6
    sharp = [Sharpness()(frame.load_image()) for frame in found.frames]
    capture = cv2.VideoCapture(str(film))
    every = [Sharpness()(capture.read()[1]) for _ in range(61)]
    assert min(sharp) > np.quantile(every, 0.75)
    assert not list(tmp_path.glob("**/*.tmp")) and found.frames[0].has(Layer.IMAGE)


def test_a_film_whose_field_of_view_is_unknown_gets_that_of_a_phone(
    film: Path, tmp_path: Path, capsys
) -> None:
    assert convert(film, tmp_path / "c") == 0
    assert "--refine-focal" in capsys.readouterr().err
    found = read_capture(tmp_path / "c")
    assert len(found) == 60  # the repeated one is left out
    assert found.frames[0].camera.intrinsics.fx == pytest.approx(80 / np.tan(np.deg2rad(32.5)))


def test_repeated_frames_are_recognized_and_never_chosen() -> None:
    rng = np.random.default_rng(0)
    one, other = rng.integers(0, 255, (2, 50, 60, 3), dtype=np.uint8)
    measure = Sharpness()
    assert [measure(image) == REPEATED for image in (one, one, other, one)] == [
        False,
        True,
        False,
        False,
    ]
    sharpness = np.array([1.0, REPEATED, 9.0, REPEATED, 2.0, 3.0])
    assert choose(sharpness, 10) == [0, 2, 4, 5]
    # The sharpest in the middle two thirds of each ten: not those at the rims, however sharp.
    sharpness = np.ones(30)
    sharpness[[4, 9, 10, 17, 22]] = [2, 9, 9, 3, 2]
    assert choose(sharpness, 3) == [4, 17, 22]


@pytest.mark.parametrize("size", [0, 5000])
def test_broken_films_are_explained(film: Path, tmp_path: Path, size: int, capsys) -> None:
    broken = tmp_path / "broken.mp4"
    broken.write_bytes(film.read_bytes()[:size])
    assert convert(broken, tmp_path / "c") == 1
    assert "broken.mp4" in capsys.readouterr().err
    assert convert(tmp_path, tmp_path / "c") == 1
    assert "expected a file, found a folder" in capsys.readouterr().err


def test_recordings_out_of_order_are_sorted_and_long_ones_thinned(
    capture: Capture, tmp_path: Path
) -> None:
    export_capture(capture, "tum", tmp_path / "tum")
    path = tmp_path / "tum/rgb.txt"
    first, *others = path.read_text().splitlines()[2:]
    path.write_text("\n".join([others[0], first, others[1]]) + "\n")
    assert [frame.time for frame in converted("tum", tmp_path / "tum", tmp_path / "a").frames] == [
        *(0.0, 0.25, 1.5)
    ]
    path.write_text("\n".join([first, *others]) + "\n")
    line = ["convert", str(tmp_path / "tum"), "--from", "tum", "--out", str(tmp_path / "c")]
    assert main([*line, "--frames", "2"]) == 0
    assert [frame.time for frame in read_capture(tmp_path / "c").frames] == [0.0, 1.5]


def test_a_realsense_recording_gives_color_and_depth_moved_to_it(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    rs: Any = pytest.importorskip("pyrealsense2", reason="pyrealsense2 is not installed")
    path = tmp_path / "walk.bag"
    try:
        images = realsense_bag.write_bag(rs, path)
    except RuntimeError:  # since 2.56 it writes another kind of file
        path = tmp_path / "walk.db3"
        images = realsense_bag.write_bag(rs, path)
    found = converted("realsense", path, tmp_path / "c")
    assert len(found) >= 4 and not found.knows_poses
    for frame in found.frames:
        k = frame.camera.intrinsics
        assert (k.fx, k.cx, k.cy) == (50, 32, 24)
        assert any((frame.load_image() == image).all() for image in images)
        depth = frame.load_depth()
        inner = depth[5:-5, 8:-8]
        np.testing.assert_allclose(inner[np.isfinite(inner)], 1.0, atol=1e-3)
        # The depth camera sees less, 1.5 cm further left: its picture ends at the sides of the color image.
        assert np.isfinite(depth[24, 10:50]).all()
