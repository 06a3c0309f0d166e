"""A handheld walk around an object: three orbits at different heights, with the shake of a hand.

The shake is colored noise with the spectrum of a person who walked around a desk with a handheld camera
(TUM RGB-D, fr2/desk, motion capture): position falls off as f^-4 and angle as f^-3 between 1 and 10 Hz, and
physiological tremor adds a low hump at 6 to 12 Hz. White noise per frame, the usual shortcut, would be far
too strong at high frequencies and far too weak at low ones.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.camera import Intrinsics
from digs_warp.checks import DigsError, check_positive
from digs_warp.geometry import invert_rigid, look_at, rigid

# Low enough to look under overhangs and high enough to see the top; 25 degrees apart, so that neighboring
# orbits share most of their view.
ELEVATIONS_DEG = (10.0, 35.0, 60.0)

WALKING_SPEED = 0.2  # [m/s] mean speed of the measured walk
SAMPLE_RATE = 60.0  # [Hz]; the measured shake ends at 12.5 Hz

# Share of a turn over which the camera climbs from one orbit to the next.
CLIMB_TURNS = 0.15

# Seconds before and after the walk, because the noise is periodic by construction.
NOISE_MARGIN = 4.0

# Camera motion counts as constant over this time [s]: about the longest exposure or read-out of a frame.
MOTION_SPAN = 1.0 / 30.0

BANDS_HZ = ((0.5, 1.0), (1.0, 3.5), (3.5, 7.0), (7.0, 12.5))

# Margin around the object's bounding sphere in the image, for shake and the parallax of the eyes.
FRAMING_MARGIN = 1.1


@dataclass(frozen=True)
class ShakeSpectrum:
    """Power spectrum of one kind of shake, summed over its three axes.

    Attributes:
        band_rms: RMS in each of BANDS_HZ, of the length of the 3-vector.
        slope: the density falls off as f^-slope.
        tremor: height of the tremor hump over the slope at its peak, relative.
    """

    band_rms: tuple[float, float, float, float]
    slope: float
    tremor: float


POSITION_SHAKE = ShakeSpectrum((8.3e-3, 2.0e-3, 0.19e-3, 0.12e-3), slope=4.0, tremor=2.0)  # [m]
ANGLE_SHAKE = ShakeSpectrum((0.91, 0.56, 0.15, 0.068), slope=3.2, tremor=0.5)  # [degree]

TREMOR_PEAK_HZ = 8.5
TREMOR_WIDTH_HZ = 1.5


def fitting_distance(radius: float, intrinsics: Intrinsics) -> float:
    """Return the distance [m] at which a sphere of ``radius`` [m] just fits the image, with margin."""
    k = intrinsics
    half_angle = np.arctan(min(0.5 * k.width / k.fx, 0.5 * k.height / k.fy))
    return FRAMING_MARGIN * check_positive("object radius", radius) / float(np.sin(half_angle))


@dataclass(frozen=True, eq=False)
class Walk:
    """A walk as a function of time, tracked at SAMPLE_RATE.

    Attributes:
        times: of the samples [s], ascending from 0, shape (n,).
        eyes: positions without shake, in the world [m], shape (n, 3).
        offsets: shake of the position, in the camera's axes [m], shape (n, 3).
        turns: shake of the direction, rotation vectors in the camera's axes [rad], shape (n, 3).
    """

    times: np.ndarray
    eyes: np.ndarray
    offsets: np.ndarray
    turns: np.ndarray

    @staticmethod
    def around(
        distance: float,
        seed: int = 0,
        elevations_deg: tuple[float, ...] = ELEVATIONS_DEG,
        shake: float = 1.0,
    ) -> "Walk":
        """Return a walk around the origin.

        Args:
            distance: of the orbits from the origin [m].
            seed: of the shake.
            elevations_deg: height of each orbit above the horizon [degree], within -80..80.
            shake: factor on the measured shake; 0: a perfect gimbal.
        """
        check_positive("orbit distance", distance)
        if not elevations_deg or max(abs(e) for e in elevations_deg) > 80:
            raise DigsError(
                f"elevations: {elevations_deg}, expected one or more within -80..80 degrees"
            )
        times, eyes = _walk(distance, np.deg2rad(elevations_deg))
        offsets, turns_deg = shake_tracks(len(times), np.random.SeedSequence(seed))
        return Walk(times, eyes, shake * offsets, shake * np.deg2rad(turns_deg))

    def moments(self, frames: int) -> list[float]:
        """Return the times [s] of ``frames`` >= 1 frames, uniformly spaced, the first at 0."""
        if frames < 1:
            raise DigsError(f"frames: {frames}, expected at least 1")
        return (np.arange(frames) * (self.times[-1] / frames)).tolist()

    def pose(self, moment: float) -> np.ndarray:
        """Return ``world_from_cam``, shape (4, 4), at a time [s]."""
        eye, offset, turn = (
            _at(moment, self.times, track) for track in (self.eyes, self.offsets, self.turns)
        )
        aimed = look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0]))
        return aimed @ rigid(_rotation(turn), offset)

    def motion(self, moment: float, span: float = MOTION_SPAN) -> tuple[np.ndarray, np.ndarray]:
        """Return the camera's velocity [m/s] and angular velocity [rad/s] at a time [s].

        Both have shape (3,), are in the camera's own axes, and are means over ``span`` seconds around the
        moment (less at the ends of the walk).
        """
        before = max(moment - 0.5 * span, 0.0)
        after = min(moment + 0.5 * span, float(self.times[-1]))
        start_from_end = invert_rigid(self.pose(before)) @ self.pose(after)
        turn = _rotation_vector(start_from_end[:3, :3])
        return start_from_end[:3, 3] / (after - before), turn / (after - before)


def shake_tracks(count: int, seed: np.random.SeedSequence) -> tuple[np.ndarray, np.ndarray]:
    """Return shake over ``count`` samples at SAMPLE_RATE: position [m] and angle [degree], (count, 3)."""
    position_seed, angle_seed = seed.spawn(2)
    return (
        _colored_noise(count, POSITION_SHAKE, np.random.default_rng(position_seed)),
        _colored_noise(count, ANGLE_SHAKE, np.random.default_rng(angle_seed)),
    )


def _walk(distance: float, elevations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] at SAMPLE_RATE and eye points, (n, 3), of a walk at constant speed."""
    turns = np.linspace(0.0, len(elevations), 2000 * len(elevations) + 1)
    elevation = np.full_like(turns, elevations[0])
    for orbit in range(1, len(elevations)):
        climb = np.clip((turns - orbit) / CLIMB_TURNS + 0.5, 0.0, 1.0)
        smooth = climb**3 * (10 - 15 * climb + 6 * climb**2)  # no jump in speed or acceleration
        elevation += (elevations[orbit] - elevations[orbit - 1]) * smooth
    azimuth = 2 * np.pi * turns
    ring = np.cos(elevation)
    points = distance * np.stack(
        [ring * np.cos(azimuth), ring * np.sin(azimuth), np.sin(elevation)], axis=1
    )
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    arrival = np.concatenate([[0.0], np.cumsum(steps)]) / WALKING_SPEED
    times = np.arange(0.0, arrival[-1], 1.0 / SAMPLE_RATE)
    eyes = np.stack([np.interp(times, arrival, axis) for axis in points.T], axis=1)
    return times, eyes


def _at(moment: float, times: np.ndarray, track: np.ndarray) -> np.ndarray:
    """Return a track, shape (n, 3), at one moment."""
    return np.array([np.interp(moment, times, axis) for axis in track.T])


def _colored_noise(count: int, spectrum: ShakeSpectrum, rng: np.random.Generator) -> np.ndarray:
    """Return three tracks of Gaussian noise with the spectrum, shape (count, 3)."""
    total = count + 2 * int(NOISE_MARGIN * SAMPLE_RATE)
    frequencies = np.fft.rfftfreq(total, 1.0 / SAMPLE_RATE)
    # Expected |coefficient|^2 of a real track whose mean square is the integral of the density.
    power = _density(frequencies, spectrum) / 3.0 * total * SAMPLE_RATE / 2.0
    normal = rng.standard_normal((3, 2, len(frequencies)))
    coefficients = np.sqrt(power / 2.0) * (normal[:, 0] + 1j * normal[:, 1])
    coefficients[:, 0] = 0.0
    tracks = np.fft.irfft(coefficients, total, axis=1)
    margin = (total - count) // 2
    return tracks[:, margin : margin + count].T


def _density(frequencies: np.ndarray, spectrum: ShakeSpectrum) -> np.ndarray:
    """Return the one-sided power spectral density, scaled so that each band has its measured RMS."""

    def shape(f: np.ndarray) -> np.ndarray:
        hump = np.exp(-0.5 * ((f - TREMOR_PEAK_HZ) / TREMOR_WIDTH_HZ) ** 2)
        return f**-spectrum.slope * (1.0 + spectrum.tremor * hump)

    density = np.zeros_like(frequencies)
    low_edge, high_edge = BANDS_HZ[0][0], BANDS_HZ[-1][1]
    for (low, high), rms in zip(BANDS_HZ, spectrum.band_rms, strict=True):
        grid = np.linspace(low, high, 4001)
        gain = rms**2 / np.trapezoid(shape(grid), grid)
        # The last band continues to the end of the spectrum, where nothing was measured and little is left.
        inside = (frequencies >= low) & ((frequencies < high) | (high == high_edge))
        density[inside] = gain * shape(frequencies[inside])
        if low == low_edge:
            # Below 0.5 Hz the person corrects: the shake fades instead of growing without bound.
            slow = frequencies < low
            edge = gain * float(shape(np.array([low]))[0])
            density[slow] = edge * (frequencies[slow] / low) ** 2
    return density


def _rotation(rotation_vector: np.ndarray) -> np.ndarray:
    """Return the matrix of a rotation vector [rad] (Rodrigues' formula)."""
    angle = float(np.linalg.norm(rotation_vector))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = rotation_vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """Return the rotation vector [rad] of a rotation by much less than half a turn."""
    skew = 0.5 * (rotation - rotation.T)
    sine_axis = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    sine = float(np.linalg.norm(sine_axis))
    return sine_axis if sine < 1e-12 else sine_axis * (np.arcsin(min(sine, 1.0)) / sine)
