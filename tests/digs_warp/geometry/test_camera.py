from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from digs_warp.checks import DigsError
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import rigid

# Nothing is centered, square or round.
INTRINSICS = Intrinsics(641, 358, 510.3, 498.7, 301.2, 190.4)


def random_camera(seed: int, intrinsics: Intrinsics = INTRINSICS) -> Camera:
    rotation = Rotation.from_quat(np.random.default_rng(seed).normal(size=4)).as_matrix()
    return Camera(intrinsics, rigid(rotation, np.random.default_rng(seed).normal(size=3)))


def random_pixels(count: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(0)
    px = random.uniform((0, 0), (INTRINSICS.width, INTRINSICS.height), size=(count, 2))
    return px, random.uniform(0.2, 8.0, size=count)


def test_unproject_and_project_are_inverse():
    px, depth = random_pixels(100)
    for seed in range(5):
        camera = random_camera(seed)
        back_px, back_depth = camera.project(camera.unproject(px, depth))
        assert_allclose(back_px, px, atol=1e-9)
        assert_allclose(back_depth, depth, atol=1e-12)


def test_a_camera_shows_what_lies_in_front_of_it_and_inside_its_image():
    camera, (px, depth) = random_camera(3), random_pixels(4)
    width, height = INTRINSICS.width, INTRINSICS.height
    assert camera.shows(px, depth).all()
    assert not camera.shows(px, -depth).any()
    rim = np.array([[0, 0], [width, 1], [1, height], [-1e-9, 1], [1, -1e-9], [np.nan, 1]])
    assert camera.shows(rim, np.ones(6)).tolist() == [True, False, False, False, False, False]


def test_cropped_camera_sees_every_point_where_the_part_of_the_image_shows_it():
    camera = Camera(Intrinsics(64, 48, 50.0, 52.0, 31.0, 25.0), np.eye(4))
    part = camera.cropped(slice(10, 40), slice(7, 20))
    points = np.array([[0.1, -0.2, 1.5], [-0.3, 0.4, 2.0]])
    px, depth = camera.project(points)
    part_px, part_depth = part.project(points)
    np.testing.assert_allclose(part_px, px - [7, 10], atol=1e-12)
    np.testing.assert_array_equal(part_depth, depth)
    assert (part.intrinsics.width, part.intrinsics.height) == (13, 30)


def test_every_third_row_and_column_sees_every_point_in_their_pixels():
    camera, (px, depth) = random_camera(1), random_pixels(50)
    points = camera.unproject(px, depth)
    thinned = camera.every(3)
    assert (thinned.intrinsics.width, thinned.intrinsics.height) == (214, 120)
    assert_allclose(3 * (thinned.project(points)[0] - 0.5) + 0.5, px, atol=1e-9)


def test_resized_camera_sees_every_point_at_the_same_place_of_its_image():
    camera = random_camera(2)
    px, depth = random_pixels(50)
    points = camera.unproject(px, depth)
    for size in ((320, 180), (1282, 716), (1, 1)):
        resized = camera.resized(*size)
        resized_px, resized_depth = resized.project(points)
        assert_allclose(resized_px / size, px / (INTRINSICS.width, INTRINSICS.height), atol=1e-9)
        assert_allclose(resized_depth, depth)
        assert (resized.intrinsics.width, resized.intrinsics.height) == size


def test_field_of_view_spans_the_image_from_edge_to_edge():
    intrinsics = Intrinsics.from_fov(800, 600, 70.0)
    camera = Camera(intrinsics, np.eye(4))
    edges = camera.unproject(np.array([[0.0, 300.0], [800.0, 300.0]]), np.ones(2))
    cosine = edges[0] @ edges[1] / np.prod(np.linalg.norm(edges, axis=1))
    assert_allclose(np.rad2deg(np.arccos(cosine)), 70.0)
    assert intrinsics.fx == intrinsics.fy
    assert (intrinsics.cx, intrinsics.cy) == (400, 300)
    assert_allclose(pixel_centers(5, 3)[0], [[0.5 + i, 0.5] for i in range(5)])


def test_right_eye_sees_a_point_shifted_by_its_disparity():
    left = random_camera(4)
    right = left.shifted_right(0.12)
    px, depth = random_pixels(50)
    right_px, right_depth = right.project(left.unproject(px, depth))
    assert_allclose(px[:, 0] - right_px[:, 0], INTRINSICS.fx * 0.12 / depth, rtol=1e-9)
    assert_allclose(right_px[:, 1], px[:, 1], atol=1e-9)
    assert_allclose(right_depth, depth)


def test_impossible_intrinsics_and_poses_are_refused():
    for name, value in (
        *(("width", 0), ("height", -3), ("fx", 0.0), ("fy", -500.0)),
        *(("fx", np.nan), ("fy", np.inf), ("cx", np.nan), ("cy", np.inf)),
    ):
        with pytest.raises(DigsError, match=r"camera: .*expected"):
            replace(INTRINSICS, **{name: value})
    mirror, larger = np.diag([1, 1, -1, 1.0]), np.diag([2, 2, 2, 1.0])
    for matrix in (mirror, larger, np.full((4, 4), np.nan), np.eye(3)):
        with pytest.raises(DigsError, match="not a rigid transform"):
            Camera(INTRINSICS, matrix)


def test_a_matrix_says_where_its_first_pixel_center_is():
    assert (
        Intrinsics.from_matrix(INTRINSICS.matrix, INTRINSICS.width, INTRINSICS.height) == INTRINSICS
    )
    shifted = INTRINSICS.matrix - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    size = INTRINSICS.width, INTRINSICS.height
    assert Intrinsics.from_matrix(shifted, *size, first_center=0) == INTRINSICS
    skewed = shifted + np.array([[0, 3.0, 0], [0, 0, 0], [0, 0, 0]])
    for broken in (skewed, np.eye(2)):
        with pytest.raises(DigsError, match=r"expected a matrix \[\[fx, 0, cx\]"):
            Intrinsics.from_matrix(broken, *size)
