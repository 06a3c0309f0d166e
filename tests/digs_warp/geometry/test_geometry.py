import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from digs_warp.geometry.rigid import (
    invert_rigid,
    is_rigid,
    look_at,
    matrix_from_quat_xyzw,
    quat_multiply,
    rigid,
    transform_points,
)


def random_rigid(seed: int) -> np.ndarray:
    rotation = Rotation.from_quat(np.random.default_rng(seed).normal(size=4)).as_matrix()
    return rigid(rotation, np.random.default_rng(seed).normal(size=3))


def test_inverse_undoes_and_chains_cancel():
    points = np.random.default_rng(0).normal(size=(2, 5, 3))
    b_from_a, c_from_b = random_rigid(1), random_rigid(2)
    there = transform_points(b_from_a, points)
    assert_allclose(transform_points(invert_rigid(b_from_a), there), points, atol=1e-12)
    assert_allclose(
        transform_points(c_from_b @ b_from_a, points), transform_points(c_from_b, there), atol=1e-12
    )
    assert_allclose(invert_rigid(b_from_a), np.linalg.inv(b_from_a), atol=1e-12)


def changed(row: int, column: int, value: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[row, column] = value
    return matrix


def test_what_is_not_rigid_is_recognized():
    for place in (
        (0, 0, -1.0),  # mirror
        (0, 0, 2.0),  # scale
        (0, 1, 0.1),  # shear
        *((0, 0, np.nan), (0, 3, np.inf)),
        *((3, 0, 0.5), (3, 3, 2.0)),  # perspective
    ):
        assert not is_rigid(changed(*place)), place
    assert not is_rigid(np.eye(3)) and not is_rigid(np.zeros((4, 4)))


def test_look_at_points_forward_keeps_the_horizon_level_and_up_is_up():
    random = np.random.default_rng(0)
    for _ in range(20):
        eye, target = random.normal(size=3), random.normal(size=3)
        up = np.array([0.0, 0.0, 1.0])
        world_from_cam = look_at(eye, target, up)
        assert is_rigid(world_from_cam, 1e-12)
        right, down, forward = world_from_cam[:3, :3].T
        assert_allclose(world_from_cam[:3, 3], eye)
        assert_allclose(forward, (target - eye) / np.linalg.norm(target - eye), atol=1e-12)
        assert_allclose(right @ up, 0.0, atol=1e-12)
        assert down @ up < 0
        # The target lies on the optical axis, in front.
        in_cam = transform_points(invert_rigid(world_from_cam), target)
        assert_allclose(in_cam, np.array([0, 0, np.linalg.norm(target - eye)]), atol=1e-12)


def test_quaternions_agree_with_an_independent_implementation_whatever_their_length():
    rotations = Rotation.from_quat(np.random.default_rng(0).normal(size=(200, 4)))
    quats, matrices = rotations.as_quat(), rotations.as_matrix()
    for factor in (1.0, -1.0, 1e-30, 1e30):
        assert_allclose(matrix_from_quat_xyzw(factor * quats), matrices, rtol=0, atol=1e-12)
    assert_array_equal(matrix_from_quat_xyzw(np.zeros(4)), np.eye(3))


def test_product_rotates_by_the_second_then_by_the_first():
    random = np.random.default_rng(3)
    a, b = random.normal(size=(2, 30, 4))
    assert_allclose(
        matrix_from_quat_xyzw(quat_multiply(a, b)),
        matrix_from_quat_xyzw(a) @ matrix_from_quat_xyzw(b),
        atol=1e-12,
    )
