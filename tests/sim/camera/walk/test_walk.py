"""The handheld walk: the object in every frame, nothing in the way, no jumps; the shake of a hand."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.signal import welch
from scipy.spatial.transform import Rotation

from digs_warp.checks import DigsError
from digs_warp.geometry.camera import Intrinsics
from digs_warp.sim.camera.walk.hand_motion import (
    ANGLE_SHAKE,
    BANDS_HZ,
    POSITION_SHAKE,
    SAMPLE_RATE,
    ShakeSpectrum,
    shake_tracks,
)
from digs_warp.sim.camera.walk.paths import fitting_distance
from digs_warp.sim.camera.walk.settings import ALL_ROUND, WALKING_SPEED, PathName, WalkSettings
from digs_warp.sim.camera.walk.walk import Subject, Walk

INTRINSICS = Intrinsics.from_fov(640, 360, 60.0)
SUBJECT = Subject(0.3, INTRINSICS)
PATHS: tuple[PathName, ...] = ("orbits", "arc", "hover", "approach")
PERFECT = WalkSettings(unsteadiness=0.0, shake=0.0)


def perfect(distance: float = 0.9, **settings: object) -> Walk:
    """A walk without wander and shake."""
    return Walk.around(SUBJECT, distance, replace(PERFECT, **settings))  # pyright: ignore[reportArgumentType]


def poses(walk: Walk, count: int) -> np.ndarray:
    """Poses at even times, ``world_from_cam``, (count, 4, 4)."""
    return np.array([walk.pose(moment) for moment in np.linspace(0, walk.end, count)])


def clearance(world_from_cam: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """Distance of the origin from the nearest of the four planes through the image's edges, (n,)."""
    k = intrinsics
    x, y, z = -np.einsum("nji,nj->in", world_from_cam[:, :3, :3], world_from_cam[:, :3, 3])
    edges = [
        (k.fx * x + k.cx * z) / np.hypot(k.fx, k.cx),
        (-k.fx * x + (k.width - k.cx) * z) / np.hypot(k.fx, k.width - k.cx),
        (k.fy * y + k.cy * z) / np.hypot(k.fy, k.cy),
        (-k.fy * y + (k.height - k.cy) * z) / np.hypot(k.fy, k.height - k.cy),
    ]
    return np.min(edges, axis=0)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("baseline", [0.0, 0.12])
def test_the_bounding_sphere_stays_in_the_images_of_both_eyes(
    path: PathName, baseline: float
) -> None:
    lenses = (INTRINSICS, Intrinsics.from_fov(480, 640, 45.0))
    for radius, intrinsics in product((0.1, 0.4, 2.0), lenses):
        distance = fitting_distance(radius, intrinsics, baseline=baseline)
        subject = Subject(radius, intrinsics, baseline=baseline)
        for seed in range(3):
            left = poses(Walk.around(subject, distance, WalkSettings(path=path), seed), 80)
            right = left.copy()
            right[:, :3, 3] += baseline * left[:, :3, 0]
            for eye in (left, right):
                assert (clearance(eye, intrinsics) > radius).all()


def test_the_margin_is_as_large_as_shake_and_wander_ask_for() -> None:
    alone = 0.3 / np.sin(np.arctan(180 / INTRINSICS.fy))
    steady, shaken = (fitting_distance(0.3, INTRINSICS, each, 0.0) / alone for each in (0.0, 1.0))
    assert 1.0 < steady < 1.05
    assert shaken > 1.08 * steady
    assert 1.15 < fitting_distance(0.3, INTRINSICS) / alone < 1.3
    assert fitting_distance(0.3, INTRINSICS, 1.0, 2.0) > fitting_distance(0.3, INTRINSICS)


@pytest.mark.parametrize("path", PATHS)
def test_the_camera_keeps_to_its_nearest_and_farthest_distance(path: PathName) -> None:
    walk = Walk.around(SUBJECT, 1.0, WalkSettings(path=path, shake=0.0, unsteadiness=2.0), 3)
    away = np.linalg.norm(poses(walk, 100)[:, :3, 3], axis=1)
    assert walk.nearest <= away.min() and away.max() <= walk.farthest


@pytest.mark.parametrize("settings", [WalkSettings(shake=0.0), WalkSettings(unsteadiness=0.0)])
def test_wander_and_shake_belong_to_the_seed(settings: WalkSettings) -> None:
    first, again, other = (poses(Walk.around(SUBJECT, 0.9, settings, n), 7) for n in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert not np.allclose(first, other, atol=1e-4)


def test_the_aim_drifts_as_far_as_the_frame_has_room() -> None:
    drifts = [
        Walk.around(SUBJECT, distance, WalkSettings(shake=0.0, duration=300.0)).turns.std(axis=0)
        for distance in (fitting_distance(0.3, INTRINSICS), 3.0)
    ]
    (up_near, across_near, roll_near), (up_far, across_far, roll_far) = np.rad2deg(drifts)
    assert up_near < 0.6 * across_near
    assert up_near < 0.7 * up_far
    assert across_far == pytest.approx(2.8, rel=0.35)
    assert roll_near == pytest.approx(roll_far)


@pytest.mark.parametrize("path", PATHS)
def test_the_camera_stays_above_the_ground(path: PathName) -> None:
    subject = Subject(0.3, INTRINSICS, ground=-0.05)
    settings = WalkSettings(path=path, elevations=(3.0,), unsteadiness=2.0, duration=60.0)
    lowest = [poses(Walk.around(subject, 1.0, settings, n), 60)[:, 2, 3].min() for n in range(3)]
    assert min(lowest) > -0.05
    free = Walk.around(SUBJECT, 1.0, settings, 0)
    assert poses(free, 60)[:, 2, 3].min() < -0.05, "no wander without a ground goes as low"


def test_a_path_into_the_ground_is_refused_and_says_from_where_it_is_not() -> None:
    subject = Subject(0.3, INTRINSICS, ground=-0.1)
    with pytest.raises(DigsError, match=r"--elevations -20 30: .*ground.*choose (-?\d+) degrees"):
        Walk.around(subject, 1.0, WalkSettings(elevations=(-20.0, 30.0)))
    Walk.around(subject, 1.0, WalkSettings(elevations=(-3.0, 30.0)))
    Walk.around(SUBJECT, 1.0, WalkSettings(elevations=(-20.0, 30.0)))


def test_the_camera_moves_at_the_speed_that_is_asked_for() -> None:
    for speed in (WALKING_SPEED, 0.6):
        walk = perfect(speed=speed)
        away = np.linalg.norm(walk.eyes, axis=1)
        np.testing.assert_allclose(away, 0.9, rtol=1e-4)
        steps = np.linalg.norm(np.diff(walk.eyes, axis=0), axis=1) / walk.times[1]
        np.testing.assert_allclose(steps, speed, rtol=0.01)


def test_orbits_make_a_full_turn_at_each_elevation() -> None:
    eyes = perfect(1.0).eyes
    elevation = np.rad2deg(np.arcsin(eyes[:, 2]))
    azimuth = np.rad2deg(np.arctan2(eyes[:, 1], eyes[:, 0])) % 360
    for level in ALL_ROUND:
        covered = np.histogram(azimuth[np.abs(elevation - level) < 5], bins=12, range=(0, 360))[0]
        assert (covered > 0).all()
    assert (np.diff(elevation) > -1e-4).all()


def test_an_arc_goes_to_and_fro_in_front_of_the_object() -> None:
    eyes = perfect(path="arc", elevations=(20.0, 40.0)).eyes
    azimuth = np.rad2deg(np.arctan2(eyes[:, 1], eyes[:, 0]))
    elevation = np.rad2deg(np.arcsin(eyes[:, 2] / 0.9))
    assert azimuth[0] == pytest.approx(-60) and azimuth.max() == pytest.approx(60, abs=0.5)
    assert azimuth[-1] == pytest.approx(-60, abs=0.5)
    np.testing.assert_allclose(elevation[[0, -1]], [20, 40], atol=0.2)


def test_an_approach_ends_at_the_distance() -> None:
    walk = perfect(path="approach", elevations=(20.0, 50.0))
    away = np.linalg.norm(walk.eyes, axis=1)
    assert (away[0], away[-1]) == (pytest.approx(2.25), pytest.approx(0.9, rel=0.01))
    assert (np.diff(away) < 0).all()
    assert np.rad2deg(np.arcsin(walk.eyes[-1, 2] / away[-1])) == pytest.approx(50, abs=0.5)


def test_a_walk_that_lasts_longer_than_its_path_turns_back() -> None:
    walk = perfect(path="approach", duration=30.0)
    away = np.linalg.norm(walk.eyes, axis=1)
    assert walk.end == pytest.approx(30.0, abs=0.1)
    turning = int(away[:600].argmin())
    assert walk.times[turning] == pytest.approx(1.35 / WALKING_SPEED, abs=0.1)
    assert away[2 * turning] > 2.1
    speed = np.diff(away) / walk.times[1]
    assert np.abs(np.diff(speed)).max() < 0.02, "without a jolt"
    assert perfect(duration=5.0).end == pytest.approx(5.0, abs=0.1)


def test_motion_leads_from_one_pose_to_the_next() -> None:
    walk = Walk.around(SUBJECT, 0.7, WalkSettings(), seed=3)
    step = 0.01
    for moment in np.linspace(0, walk.end - step, 9):
        velocity, angular = walk.motion(moment + step / 2, span=step)
        moved = np.linalg.inv(walk.pose(moment)) @ walk.pose(moment + step)
        turned = Rotation.from_rotvec(step * angular).as_matrix()
        np.testing.assert_allclose(moved[:3, 3], step * velocity, atol=1e-9)
        np.testing.assert_allclose(moved[:3, :3], turned, atol=1e-9)


SPECTRA = (POSITION_SHAKE, ANGLE_SHAKE)


@pytest.fixture(scope="module")
def long_tracks() -> tuple[np.ndarray, np.ndarray]:
    """Forty minutes of shake."""
    return shake_tracks(int(2400 * SAMPLE_RATE), np.random.SeedSequence(5))


@pytest.mark.parametrize(("index", "spectrum"), list(enumerate(SPECTRA)))
def test_every_band_has_the_measured_rms(
    long_tracks: tuple[np.ndarray, np.ndarray], index: int, spectrum: ShakeSpectrum
) -> None:
    track = long_tracks[index]
    frequencies = np.fft.rfftfreq(len(track), 1 / SAMPLE_RATE)
    power = 2 * (np.abs(np.fft.rfft(track, axis=0)) ** 2).sum(axis=1) / len(track) ** 2
    for (low, high), expected in zip(BANDS_HZ, spectrum.band_rms, strict=True):
        rms = np.sqrt(power[(frequencies >= low) & (frequencies < high)].sum())
        assert rms == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize(("index", "slope", "rise"), [(0, 4.0, 1.8), (1, 3.2, 1.0)])
def test_the_spectrum_falls_off_as_measured_and_tremor_rises_over_it(
    long_tracks: tuple[np.ndarray, np.ndarray], index: int, slope: float, rise: float
) -> None:
    f, power = welch(long_tracks[index], fs=SAMPLE_RATE, nperseg=2048, axis=0)
    f, power = f[1:], power.sum(axis=1)[1:]
    fitted = (f >= 1) & (f <= 10)
    found = -np.polyfit(np.log(f[fitted]), np.log(power[fitted]), 1)[0]
    # Bands with an RMS of their own and the tremor hump bend the line a little.
    assert found == pytest.approx(slope, abs=0.5)
    flat = power * f**slope
    peak, before, after = (flat[(f > low) & (f < low + 1)].mean() for low in (8, 5, 11.5))
    assert peak > rise * max(before, after)
