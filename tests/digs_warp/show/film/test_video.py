"""Frames of a film and the files that they end in."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from digs_warp.checks import DigsError
from digs_warp.data.images import to_uint8
from digs_warp.geometry.camera import Intrinsics
from digs_warp.show.film.camera_path import find_subject, orbit
from digs_warp.show.film.video import Clock, shoot, write_video
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.render import render
from reference.full_disk import largest_file
from reference.tiny_capture import ball

CAMERAS = orbit(find_subject(ball()), Intrinsics.from_fov(96, 64, 45.0), 6)


@pytest.fixture(scope="module")
def frames() -> list[np.ndarray]:
    return list(shoot(ball(), CAMERAS))


def test_frames_are_the_views_of_the_renderer(frames: list[np.ndarray]) -> None:
    center = ball().means.mean(axis=0)
    for frame, camera in zip(frames, CAMERAS, strict=True):
        view = render(ball(), camera, near=near_plane(camera, center))
        np.testing.assert_array_equal(frame, to_uint8(view.image))
    assert (frames[0] != frames[3]).any()


def test_the_clock_leaves_out_the_first_of_several_frames() -> None:
    clock = Clock()
    assert np.isnan(clock.milliseconds)
    (frame,) = shoot(ball(), CAMERAS[:1], background=(1.0, 0.0, 0.5), clock=clock)
    assert frame[0, 0].tolist() == [255, 0, 128]
    assert clock.milliseconds == pytest.approx(1e3 * clock.seconds[0])
    assert Clock([5.0, 0.1, 0.3]).milliseconds == pytest.approx(200)
    assert Clock([5.0, 0.1, 0.3]).frame_rate == pytest.approx(5)


def test_a_film_has_one_size_and_may_have_no_frames() -> None:
    with pytest.raises(DigsError, match="different image sizes"):
        next(shoot(ball(), [CAMERAS[0], CAMERAS[1].resized(48, 32)]))
    assert list(shoot(ball(), [])) == []


def test_a_video_shows_the_frames_in_their_order(tmp_path: Path, frames) -> None:
    assert write_video(tmp_path / "a.mp4", iter(frames), 25.0) == 6
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]
    film = cv2.VideoCapture(str(tmp_path / "a.mp4"))
    assert film.get(cv2.CAP_PROP_FPS) == 25.0
    for frame in frames:
        shown, pixels = film.read()
        assert shown
        difference = pixels[..., ::-1].astype(float) - frame
        assert np.sqrt((difference**2).mean()) < 16  # lossy, but this frame and no other
    assert not film.read()[0]


def test_a_gif_shows_the_frames_and_repeats(tmp_path: Path, frames) -> None:
    assert write_video(tmp_path / "a.gif", iter(frames), 10.0) == 6
    with Image.open(tmp_path / "a.gif") as film:
        assert (film.info["duration"], film.info["loop"]) == (100, 0)
        for number, frame in enumerate(frames):
            film.seek(number)
            difference = np.array(film.convert("RGB")).astype(float) - frame
            assert np.abs(difference).mean() < 6  # 256 colors for a ball of all colors
            with pytest.raises(EOFError):
                film.seek(6)


@pytest.mark.parametrize("name", ["a.mp4", "a.gif"])
def test_what_cannot_be_written_leaves_the_old_film(tmp_path: Path, frames, name: str) -> None:
    write_video(tmp_path / name, iter(frames), 10.0)
    before = (tmp_path / name).read_bytes()
    for size in (0, len(before) // 2, len(before) - 1):
        with largest_file(size), pytest.raises(DigsError, match=rf"{name}': cannot be written"):
            write_video(tmp_path / name, iter(frames), 10.0)
    with pytest.raises(DigsError, match="0 frames"):
        write_video(tmp_path / name, iter([]), 10.0)
    with pytest.raises(DigsError, match=r"expected \.mp4 or \.gif"):
        write_video(tmp_path / "a.avi", iter(frames), 10.0)
    assert (tmp_path / name).read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == [name]
