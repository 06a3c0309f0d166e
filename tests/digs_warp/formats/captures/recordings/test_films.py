"""Films: sharp, evenly spaced frames; recordings of RealSense cameras by their own library."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from digs_warp.cli import main
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.layers import Layer
from digs_warp.data.sharpness import REPEATED, Sharpness
from digs_warp.formats.captures.formats import export_capture
from digs_warp.formats.captures.video import choose
from digs_warp.show.film.video import write_video
from reference import realsense_bag
from reference.recorded import converted

WIDTH, HEIGHT = 160, 120


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walk along a wall; all but every fifth frame are blurred, and one is repeated."""
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.integers(0, 255, (HEIGHT, 600, 3), dtype=np.uint8), (0, 0), 1.2)
    frames = [np.ascontiguousarray(wall[:, 6 * n : 6 * n + WIDTH]) for n in range(60)]
    frames = [f if n % 5 == 2 else cv2.GaussianBlur(f, (0, 0), 2) for n, f in enumerate(frames)]
    path = tmp_path_factory.mktemp("film") / "walk.mp4"
    write_video(path, [*frames[:30], frames[29], *frames[30:]], 30)
    return path


def convert(film: Path, out: Path, *more: str) -> int:
    return main(["convert", str(film), "--from", "video", "--out", str(out), *more])


def test_the_sharp_frames_of_a_film_become_a_capture_without_poses(
    film: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert convert(film, tmp_path / "c", "--frames", "12", "--fov-deg", "70") == 0
    assert "poses unknown: 'reconstruct --poses sfm' finds them" in capsys.readouterr().out
    found = read_capture(tmp_path / "c")
    assert not found.knows_poses and len(found) == 12
    k = found.frames[0].camera.intrinsics
    assert k.fx == pytest.approx(WIDTH / 2 / np.tan(np.deg2rad(35)))
    gaps = np.diff([frame.time for frame in found.frames])
    assert 0.5 / 6 < gaps.min() and gaps.max() < 2 / 6
    sharp = [Sharpness()(frame.load_image()) for frame in found.frames]
    capture = cv2.VideoCapture(str(film))
    every = [Sharpness()(capture.read()[1]) for _ in range(61)]
    assert min(sharp) > np.quantile(every, 0.75)
    assert not list(tmp_path.glob("**/*.tmp")) and found.frames[0].has(Layer.IMAGE)


def test_a_film_whose_field_of_view_is_unknown_gets_that_of_a_phone(
    film: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
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
def test_broken_films_are_explained(
    film: Path, tmp_path: Path, size: int, capsys: pytest.CaptureFixture[str]
) -> None:
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
