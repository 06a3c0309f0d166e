"""The handheld walk: measured spectrum, even timing, the object in every frame."""

import numpy as np
import pytest
from scipy.signal import welch
from scipy.spatial.transform import Rotation

from digs_warp.camera import Camera, Intrinsics
from digs_warp.checks import DigsError
from digs_warp.geometry import is_rigid
from digs_warp.sim.trajectory import (
    ANGLE_SHAKE,
    BANDS_HZ,
    ELEVATIONS_DEG,
    POSITION_SHAKE,
    SAMPLE_RATE,
    WALKING_SPEED,
    ShakeSpectrum,
    Walk,
    fitting_distance,
    shake_tracks,
)

INTRINSICS = Intrinsics.from_fov(640, 360, 60.0)


def handheld_orbits(
    frames: int,
    distance: float,
    seed: int = 0,
    elevations_deg: tuple[float, ...] = ELEVATIONS_DEG,
    shake: float = 1.0,
) -> list[tuple[np.ndarray, float]]:
    """Poses, ``world_from_cam``, and times of a walk."""
    walk = Walk.around(distance, seed, elevations_deg, shake)
    return [(walk.pose(moment), moment) for moment in walk.moments(frames)]


@pytest.fixture(scope="module")
def long_tracks() -> tuple[np.ndarray, np.ndarray]:
    """Forty minutes of shake."""
    return shake_tracks(int(2400 * SAMPLE_RATE), np.random.SeedSequence(5))


def density(track: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    frequencies, power = welch(track, fs=SAMPLE_RATE, nperseg=2048, axis=0)
    return frequencies, power.sum(axis=1)


@pytest.mark.parametrize(("index", "spectrum"), [(0, POSITION_SHAKE), (1, ANGLE_SHAKE)])
def test_every_band_has_the_measured_rms(
    long_tracks: tuple[np.ndarray, np.ndarray], index: int, spectrum: ShakeSpectrum
) -> None:
    track = long_tracks[index]
    frequencies = np.fft.rfftfreq(len(track), 1 / SAMPLE_RATE)
    power = 2 * (np.abs(np.fft.rfft(track, axis=0)) ** 2).sum(axis=1) / len(track) ** 2
    for (low, high), expected in zip(BANDS_HZ, spectrum.band_rms, strict=True):
        rms = np.sqrt(power[(frequencies >= low) & (frequencies < high)].sum())
        assert rms == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize(("index", "slope"), [(0, -4.0), (1, -3.2)])
def test_the_spectrum_falls_off_as_measured(
    long_tracks: tuple[np.ndarray, np.ndarray], index: int, slope: float
) -> None:
    frequencies, power = density(long_tracks[index])
    fitted = (frequencies >= 1) & (frequencies <= 10)
    found = np.polyfit(np.log(frequencies[fitted]), np.log(power[fitted]), 1)[0]
    # Bands with an RMS of their own and the tremor hump bend the line a little.
    assert found == pytest.approx(slope, abs=0.5)


def test_tremor_rises_over_the_slope(long_tracks: tuple[np.ndarray, np.ndarray]) -> None:
    frequencies, power = density(long_tracks[0])
    flattened = power * frequencies**4
    peak = flattened[(frequencies > 8) & (frequencies < 9)].mean()
    assert peak > 1.8 * flattened[(frequencies > 5) & (frequencies < 6)].mean()
    assert peak > 1.8 * flattened[(frequencies > 11.5) & (frequencies < 12.5)].mean()


def test_frames_are_evenly_spaced_in_time_at_walking_speed() -> None:
    poses = handheld_orbits(120, distance=0.9, shake=0.0)
    times = np.array([time for _, time in poses])
    assert times[0] == 0.0
    np.testing.assert_allclose(np.diff(times), times[1], rtol=1e-9)
    eyes = np.array([matrix[:3, 3] for matrix, _ in poses])
    np.testing.assert_allclose(np.linalg.norm(eyes, axis=1), 0.9, rtol=1e-4)
    # Chords of a circle are shorter than its arcs: 0.45 % at this spacing on the low orbit.
    speed = np.linalg.norm(np.diff(eyes, axis=0), axis=1) / times[1]
    assert speed[:30].mean() == pytest.approx(WALKING_SPEED, rel=0.01)


def test_the_walk_makes_a_full_turn_at_each_elevation() -> None:
    poses = handheld_orbits(300, distance=1.0, shake=0.0)
    eyes = np.array([matrix[:3, 3] for matrix, _ in poses])
    elevation = np.rad2deg(np.arcsin(eyes[:, 2]))
    azimuth = np.rad2deg(np.arctan2(eyes[:, 1], eyes[:, 0])) % 360
    for level in ELEVATIONS_DEG:
        covered = np.histogram(azimuth[np.abs(elevation - level) < 5], bins=12, range=(0, 360))[0]
        assert (covered > 0).all()
    assert (np.diff(elevation) > -1e-4).all()


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("radius", [0.15, 0.3, 0.5])
def test_every_frame_shows_the_object(seed: int, radius: float) -> None:
    distance = fitting_distance(radius, INTRINSICS)
    for matrix, _ in handheld_orbits(90, distance, seed):
        assert is_rigid(matrix)
        camera = Camera(INTRINSICS, matrix)
        (u, v), depth = camera.project(np.zeros(3))
        size = INTRINSICS.fy * radius / np.sqrt(depth**2 - radius**2)
        assert depth > radius
        # At most a quarter of the bounding sphere's radius leaves the image: an object hardly fills it.
        assert -0.25 * size < v - size and v + size < 360 + 0.25 * size
        assert 0 < u - size and u + size < 640


def test_the_same_seed_gives_the_same_walk_and_another_one_differs() -> None:
    first, again, other = (handheld_orbits(7, 0.9, seed) for seed in (3, 3, 4))
    for (a, time_a), (b, time_b), (c, _) in zip(first, again, other, strict=True):
        np.testing.assert_array_equal(a, b)
        assert time_a == time_b
        assert not np.array_equal(a, c)


def test_bad_settings_are_refused() -> None:
    with pytest.raises(DigsError, match="frames: 0"):
        handheld_orbits(0, 1.0)
    with pytest.raises(DigsError, match="orbit distance"):
        handheld_orbits(3, -1.0)
    with pytest.raises(DigsError, match="elevations"):
        handheld_orbits(3, 1.0, elevations_deg=(90.0,))
    with pytest.raises(DigsError, match="object radius"):
        fitting_distance(float("nan"), INTRINSICS)


def test_one_frame_is_enough() -> None:
    ((matrix, time),) = handheld_orbits(1, 0.9)
    assert is_rigid(matrix) and time == 0.0


def test_without_shake_the_camera_moves_at_walking_speed_and_turns_with_the_orbit() -> None:
    walk = Walk.around(distance=0.9, elevations_deg=(0.0,), shake=0.0)
    for moment in walk.moments(7):
        velocity, angular = walk.motion(moment)
        # Counterclockwise seen from above, looking inward: to the right; it turns about its down axis.
        np.testing.assert_allclose(velocity, [WALKING_SPEED, 0, 0], rtol=1e-3, atol=2e-3)
        np.testing.assert_allclose(angular, [0, -WALKING_SPEED / 0.9, 0], rtol=1e-2, atol=1e-3)


def test_motion_leads_from_one_pose_to_the_next() -> None:
    walk = Walk.around(distance=0.7, seed=3)
    step = 0.01
    for moment in walk.moments(9):
        velocity, angular = walk.motion(moment + step / 2, span=step)
        moved = np.linalg.inv(walk.pose(moment)) @ walk.pose(moment + step)
        turned = Rotation.from_rotvec(step * angular).as_matrix()
        np.testing.assert_allclose(moved[:3, 3], step * velocity, atol=1e-9)
        np.testing.assert_allclose(moved[:3, :3], turned, atol=1e-9)


def test_the_walk_and_its_frames_agree() -> None:
    walk = Walk.around(distance=0.8, seed=2)
    frames = handheld_orbits(5, distance=0.8, seed=2)
    assert [moment for _, moment in frames] == walk.moments(5)
    for pose, moment in frames:
        np.testing.assert_array_equal(pose, walk.pose(moment))
