"""Camera paths of films: where they stand, what they see."""

import numpy as np
import pytest

from digs_warp.checks import DigsError
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
from reference.splat_files import random_gaussians

SUBJECT = Subject(np.array([1.0, 2.0, 3.0]), 0.25)
UP = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("width", "height", "elevation"),
    [(320, 180, -80.0), (180, 320, 20.0), (320, 180, 89.0)],
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
