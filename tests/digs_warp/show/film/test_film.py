"""Films: where their cameras stand, what they see, and the files that they end in."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import CLASSIC
from digs_warp.data.images import to_uint8
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.show.film.camera_path import (
    Subject,
    along,
    find_framed_subject,
    find_subject,
    orbit,
    up_of,
)
from digs_warp.show.film.video import Clock, shoot, times_as_large, write_video
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.render import render
from reference.full_disk import largest_file
from reference.splat_files import random_gaussians
from reference.tiny_capture import ball

SUBJECT = Subject(np.array([1.0, 2.0, 3.0]), 0.25)
UP = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("width", "height", "elevation"), [(320, 180, -80.0), (180, 320, 20.0), (320, 180, 89.0)]
)
def test_an_orbit_shows_the_whole_ball_as_large_as_it_fits(width, height, elevation) -> None:
    k = Intrinsics.from_fov(width, height, 40.0)
    cameras = orbit(SUBJECT, k, 8, elevation)
    assert len(cameras) == 8
    middle = np.mean([camera.center_world for camera in cameras], axis=0)
    np.testing.assert_allclose(middle[:2], SUBJECT.center_world[:2], atol=1e-9)  # an even turn
    rim = np.random.default_rng(0).normal(size=(4000, 3))
    rim *= SUBJECT.radius / np.linalg.norm(rim, axis=1, keepdims=True)
    for camera in cameras:
        center, _ = camera.project(SUBJECT.center_world)
        np.testing.assert_allclose(center, (width / 2, height / 2), atol=1e-6)
        px, depth = camera.project(SUBJECT.center_world + rim)
        assert (depth > 0).all()
        reach = np.abs(px - (width / 2, height / 2)).max(axis=0) / (width / 2, height / 2)
        assert 0.8 < reach.max() < 1.0
        height_over = camera.center_world[2] - SUBJECT.center_world[2]
        distance = np.linalg.norm(camera.center_world - SUBJECT.center_world)
        np.testing.assert_allclose(np.rad2deg(np.arcsin(height_over / distance)), elevation)
        assert camera.world_from_cam[2, 1] < 0  # image rows go down


def test_strays_and_faint_gaussians_do_not_move_the_subject() -> None:
    g = random_gaussians(2000, 0)
    g.means[:] = g.means * 0.1 + (5, 0, 0)
    g.opacity_logits[:] = 3
    calm = find_subject(g)
    g.means[:5] = 1000.0
    g.means[5:400], g.opacity_logits[5:400] = -50.0, -4.0
    moved = find_subject(g)
    np.testing.assert_allclose(moved.center_world, calm.center_world, atol=0.02)
    np.testing.assert_allclose(moved.radius, calm.radius, rtol=0.05)
    np.testing.assert_allclose(calm.center_world, (5, 0, 0), atol=0.02)


def test_a_thin_part_is_in_the_frame_and_strays_are_not() -> None:
    g = random_gaussians(4000, 0)
    g.means[:] = g.means / np.linalg.norm(g.means, axis=1, keepdims=True) * 0.1
    g.opacity_logits[:] = 3
    g.means[:20] = np.linspace((0, 0, 0.1), (0, 0, 0.18), 20)  # half a percent: a rod
    g.means[20:40] = (3.0, 0.0, 0.0)
    subject = find_framed_subject(g)
    assert find_subject(g).radius < 0.11
    rod = np.linalg.norm(g.means[:20] - subject.center_world, axis=1)
    assert rod.max() < 1.05 * subject.radius < 0.18
    alone = random_gaussians(1, 0)
    alone.log_scales[:], alone.opacity_logits[:] = np.log(0.1), 2.0
    assert find_framed_subject(alone).radius == pytest.approx(0.3, rel=1e-5)


def test_up_is_z_unless_the_cameras_say_otherwise() -> None:
    k = Intrinsics.from_fov(64, 48, 40.0)
    steep = [Camera(k, look_at(np.array([0.3, 0.0, 0.7]), np.zeros(3), UP))] * 3
    np.testing.assert_array_equal(up_of(steep), UP)
    np.testing.assert_array_equal(up_of([Camera(k, np.eye(4))]), (0, -1, 0))  # OpenCV axes
    turn = orbit(SUBJECT, k, 8, 20.0, up=np.array([0.0, -1.0, 0.0]))
    for camera in turn:
        assert (camera.center_world - SUBJECT.center_world)[1] < 0
        assert camera.cam_from_world[1, 1] > 0.9  # y is down in the image
    np.testing.assert_array_equal(up_of(turn), (0, -1, 0))


def test_a_recorded_path_goes_through_its_poses() -> None:
    eyes = [(1.0, 0.1 * t, 0.5) for t in range(5)]
    poses = [look_at(np.array(eye), np.zeros(3), UP) for eye in eyes]
    times = [0.0, 0.1, 0.2, 0.3, 0.4]
    k = Intrinsics.from_fov(64, 48, 40.0)
    for camera, pose in zip(along(poses, times, k, 5), poses, strict=True):
        np.testing.assert_allclose(camera.world_from_cam, pose, atol=1e-9)
    fine = along(poses, times, k, 41)
    steps = np.linalg.norm(np.diff([c.center_world for c in fine], axis=0), axis=1)
    np.testing.assert_allclose(steps, 0.01, rtol=1e-6)  # a straight, even path stays so


def test_short_and_broken_paths() -> None:
    k = Intrinsics.from_fov(64, 48, 40.0)
    one = along([np.eye(4)], [0.0], k, 3)
    assert [c.center_world.tolist() for c in one] == [[0, 0, 0]] * 3
    for wrong, message in (
        (lambda: along([np.eye(4)] * 2, [1.0, 1.0], k, 3), "do not increase"),
        (lambda: along([], [], k, 3), "0 poses"),
        (lambda: orbit(SUBJECT, k, 3, 90.0), "elevation 90"),
        (lambda: orbit(SUBJECT, k, 0), "0 frames"),
        (lambda: find_subject(random_gaussians(0, 0)), "0 Gaussians"),
    ):
        with pytest.raises(DigsError, match=message):
            wrong()


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


def test_what_is_finer_than_a_pixel_is_averaged() -> None:
    small = CAMERAS[0].resized(24, 16)
    for g, times in ((ball(), 2), (replace(ball(), screen_filter=CLASSIC), 1)):
        (frame,) = shoot(g, [small])
        drawn = small.resized(24 * times, 16 * times)
        fine = render(g, drawn, near=near_plane(small, g.means.mean(axis=0))).image
        fine = fine.reshape(16, times, 24, times, 3).mean(axis=(1, 3))
        np.testing.assert_array_equal(frame, to_uint8(fine))
    at_origin = replace(ball(), means=ball().means - ball().means[0])
    flat = replace(at_origin, log_scales=ball().log_scales * 0 - 200)
    assert times_as_large(flat, Camera(small.intrinsics, np.eye(4))) == 4


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
