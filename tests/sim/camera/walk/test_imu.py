"""Accelerometer and gyroscope: without errors they lead back to the poses, and their errors are as stated."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from digs_warp.checks import CaptureError
from digs_warp.data.imu import ImuTrack, read_imu, write_imu
from digs_warp.geometry.camera import Intrinsics
from digs_warp.sim.camera.walk.imu import (
    ACCELEROMETER,
    GRAVITY,
    GYROSCOPE,
    RATE,
    ImuNoise,
    measured_imu,
    true_imu,
)
from digs_warp.sim.camera.walk.settings import WalkSettings
from digs_warp.sim.camera.walk.walk import Subject, Walk

DURATION = 3.0  # [s]


@pytest.fixture(scope="module")
def walk() -> Walk:
    """A walk with everything that a hand does."""
    subject = Subject(0.3, Intrinsics.from_fov(640, 360, 60.0))
    return Walk.around(subject, 0.9, WalkSettings(duration=DURATION), seed=4)


@pytest.fixture(scope="module")
def truth(walk: Walk) -> ImuTrack:
    return true_imu(walk, DURATION)


def integrated(track: ImuTrack, walk: Walk) -> tuple[np.ndarray, np.ndarray]:
    """Positions and rotations by dead reckoning from the first pose and velocity, by the trapezoidal rule."""
    step = 1e-5
    first, second, third = (walk.pose(n * step) for n in range(3))
    velocity = (-3 * first + 4 * second - third)[:3, 3] / (2 * step)
    position, rotation = first[:3, 3], Rotation.from_matrix(first[:3, :3])
    positions, rotations = [position], [rotation]
    for n in range(len(track.times) - 1):
        step = track.times[n + 1] - track.times[n]
        turned = rotation * Rotation.from_rotvec(
            step * (track.angular_velocity[n] + track.angular_velocity[n + 1]) / 2
        )
        before = rotation.apply(track.acceleration[n]) + GRAVITY
        after = turned.apply(track.acceleration[n + 1]) + GRAVITY
        position = position + step * velocity + step**2 * (2 * before + after) / 6
        velocity = velocity + step * (before + after) / 2
        rotation = turned
        positions.append(position)
        rotations.append(rotation)
    return np.array(positions), np.array([each.as_matrix() for each in rotations])


@pytest.mark.parametrize(("faster", "most_mm", "most_deg"), [(1, 4.0, 0.01), (4, 0.4, 0.001)])
def test_without_errors_the_samples_lead_back_to_the_poses(
    walk: Walk, faster: int, most_mm: float, most_deg: float
) -> None:
    """The trapezoidal rule errs by the square of the time between samples, and nothing else does."""
    track = true_imu(walk, DURATION, faster * RATE)
    assert len(track.times) == faster * RATE * DURATION + 1
    positions, rotations = integrated(track, walk)
    poses = np.array([walk.pose(moment) for moment in track.times])
    assert np.linalg.norm(positions[-1] - positions[0]) > 0.4
    assert 1e3 * np.linalg.norm(positions - poses[:, :3, 3], axis=1).max() < most_mm
    off = Rotation.from_matrix(rotations.transpose(0, 2, 1) @ poses[:, :3, :3])
    assert np.rad2deg(off.magnitude().max()) < most_deg


def test_a_camera_at_rest_feels_what_holds_it_up() -> None:
    subject = Subject(0.3, Intrinsics.from_fov(640, 360, 60.0))
    still = WalkSettings(path="hover", elevations=(0.0,), shake=0.0, unsteadiness=0.0)
    track = true_imu(Walk.around(subject, 0.9, still), 1.0)
    np.testing.assert_allclose(track.angular_velocity, 0.0, atol=1e-9)
    # The camera's y axis points down.
    np.testing.assert_allclose(track.acceleration, [[0, -9.81, 0]] * 201, atol=1e-6)


@pytest.mark.parametrize("noise", [GYROSCOPE, ACCELEROMETER])
def test_errors_have_the_stated_figures(noise: ImuNoise) -> None:
    seconds = 400
    errors = np.stack(
        [noise.draw(int(seconds * RATE), np.random.default_rng(n)) for n in range(6)], axis=-1
    ).reshape(-1, 18)
    white = np.diff(errors, axis=0).std() / np.sqrt(2)
    assert white == pytest.approx(noise.density * np.sqrt(RATE), rel=0.02)
    assert errors[:200].mean(axis=0).std() == pytest.approx(noise.bias, rel=0.5)
    means = errors.reshape(seconds // 40, -1, 18).mean(axis=1)
    # From one T to the next the mean of a random walk changes by the variance 2 T / 3, and white noise adds.
    expected = np.sqrt(noise.walk**2 * 40 * 2 / 3 + 2 * noise.density**2 / 40)
    assert np.diff(means, axis=0).std() == pytest.approx(expected, rel=0.2)


def test_the_same_seed_gives_the_same_errors_and_strength_scales_them(truth: ImuTrack) -> None:
    once, twice, other = (measured_imu(truth, 1, s) for s in (1.0, 2.0, 1.0))
    np.testing.assert_array_equal(once.acceleration, other.acceleration)
    for part in ("angular_velocity", "acceleration"):
        error, double = (getattr(each, part) - getattr(truth, part) for each in (once, twice))
        np.testing.assert_allclose(double, 2 * error, atol=1e-12)
        assert not np.array_equal(getattr(measured_imu(truth, 2, 1.0), part), getattr(once, part))
        exact = measured_imu(truth, 1, 0.0)
        np.testing.assert_array_equal(getattr(exact, part), getattr(truth, part))


def test_samples_come_back_from_a_file(truth: ImuTrack, tmp_path: Path) -> None:
    write_imu(tmp_path / "imu.csv", truth)
    found = read_imu(tmp_path / "imu.csv")
    np.testing.assert_allclose(found.times, truth.times, atol=1e-9)
    np.testing.assert_allclose(found.angular_velocity, truth.angular_velocity, rtol=1e-8)
    np.testing.assert_allclose(found.acceleration, truth.acceleration, rtol=1e-8)
    (tmp_path / "imu.csv").write_text("#head\n0,1,2,3,4,5,6\n5000000,1,2,x,4,5,6\n")
    with pytest.raises(CaptureError, match=r"imu\.csv', line 3: found '5000000,1,2,x"):
        read_imu(tmp_path / "imu.csv")
