"""What an accelerometer and a gyroscope in the camera measure on a walk.

The sensor sits in the camera that takes the images and has its axes. Its errors are those of the usual model
(white noise, and a bias that starts anywhere and wanders), with the figures of the ADIS16448 in the sensor
files of the EuRoC data sets; the bias at the start is that of a phone after its calibration, tuned.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from digs_warp.data.imu import ImuTrack
from digs_warp.sim.camera.walk.walk import Walk

RATE = 200.0  # [Hz]
GRAVITY = np.array([0.0, 0.0, -9.81])  # [m/s^2] in the world

# Step of the derivatives [s]: the curve of the walk is exact to 1e-16 m, and its shake ends at 30 Hz.
STEP = 1e-3

# Identifies the errors in the seeds.
ERRORS = 108


@dataclass(frozen=True)
class ImuNoise:
    """Errors along each axis of a sensor.

    Attributes:
        density: of its white noise [unit / sqrt(Hz)].
        walk: of its bias [unit / s / sqrt(Hz)].
        bias: standard deviation of the bias at the start [unit].
    """

    density: float
    walk: float
    bias: float

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Return the errors of ``count`` samples, (count, 3)."""
        start = self.bias * rng.standard_normal(3)
        steps = self.walk / np.sqrt(RATE) * rng.standard_normal((count, 3))
        white = self.density * np.sqrt(RATE) * rng.standard_normal((count, 3))
        return start + np.cumsum(steps, axis=0) + white


GYROSCOPE = ImuNoise(density=1.6968e-4, walk=1.9393e-5, bias=5e-3)  # [rad/s]
ACCELEROMETER = ImuNoise(density=2.0e-3, walk=3.0e-3, bias=0.05)  # [m/s^2]


def imu_facts(strength: float) -> dict[str, Any]:
    """Return the figures of the sensor as the index of a capture holds them; ``strength`` see below."""
    sensors = {"gyroscope": GYROSCOPE, "accelerometer": ACCELEROMETER}
    figures = {
        name: {key: strength * value for key, value in asdict(noise).items()}
        for name, noise in sensors.items()
    }
    return {"rate": RATE, "gravity": -float(GRAVITY[2]), **figures}


def true_imu(walk: Walk, end: float, rate: float = RATE) -> ImuTrack:
    """Return what a sensor without errors measures from 0 to ``end`` [s], at a rate [Hz]."""
    from scipy.spatial.transform import Rotation

    times = np.arange(int(end * rate + 1e-6) + 1) / rate
    # Derivatives need a step on either side.
    middles = np.clip(times, STEP, walk.end - STEP)
    around = np.array([[walk.pose(m + d) for d in (-STEP, 0.0, STEP)] for m in middles])
    before, now, after = around[:, :, :3, 3].transpose(1, 0, 2)
    rotations = around[:, :, :3, :3]
    turned = rotations[:, 0].transpose(0, 2, 1) @ rotations[:, 2]
    force = (before - 2 * now + after) / STEP**2 - GRAVITY
    return ImuTrack(
        times,
        Rotation.from_matrix(turned).as_rotvec() / (2 * STEP),
        np.einsum("nji,nj->ni", rotations[:, 1], force),
    )


def measured_imu(truth: ImuTrack, seed: int, strength: float) -> ImuTrack:
    """Return what a sensor reports.

    Args:
        truth: without errors.
        seed: of the errors.
        strength: factor on them.
    """
    count = len(truth.times)
    gyroscope_seed, accelerometer_seed = np.random.SeedSequence([seed, ERRORS]).spawn(2)
    turning = GYROSCOPE.draw(count, np.random.default_rng(gyroscope_seed))
    pushing = ACCELEROMETER.draw(count, np.random.default_rng(accelerometer_seed))
    return ImuTrack(
        truth.times,
        truth.angular_velocity + strength * turning,
        truth.acceleration + strength * pushing,
    )
