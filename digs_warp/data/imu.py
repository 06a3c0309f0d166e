"""Recordings of an accelerometer and a gyroscope, in the text format of the EuRoC data sets."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.bounds import TEXT
from digs_warp.checks import CaptureError
from digs_warp.record.files import read_text, write_atomically

# In a capture folder: what the sensor reports, and the same without its errors.
IMU, IMU_TRUE = "imu.csv", "imu_true.csv"

_AXES = "xyz"
_HEADER = ",".join(
    [
        "#timestamp [ns]",
        *(f"w_RS_S_{axis} [rad s^-1]" for axis in _AXES),
        *(f"a_RS_S_{axis} [m s^-2]" for axis in _AXES),
    ]
)


@dataclass(frozen=True, eq=False)
class ImuTrack:
    """Samples of an IMU.

    Attributes:
        times: [s], ascending, shape (n,); those of the frames count from the same moment.
        angular_velocity: in the axes of the camera [rad/s], shape (n, 3).
        acceleration: specific force in the same axes [m/s^2], shape (n, 3): at rest it points up, 9.81.
    """

    times: np.ndarray
    angular_velocity: np.ndarray
    acceleration: np.ndarray


def write_imu(path: Path, track: ImuTrack) -> None:
    """Write the samples.

    Raises:
        DigsError: the disk is full, or the file cannot be written.
    """
    stamps = np.round(1e9 * track.times).astype(np.int64).tolist()
    values = np.hstack([track.angular_velocity, track.acceleration]).tolist()
    lines = [
        ",".join([str(stamp), *(f"{value:.9g}" for value in row)])
        for stamp, row in zip(stamps, values, strict=True)
    ]
    write_atomically(path, "\n".join([_HEADER, *lines, ""]).encode())


def read_imu(path: Path) -> ImuTrack:
    """Read the samples.

    Raises:
        CaptureError: a file that is missing or holds something else; says which line.
    """
    rows: list[list[float]] = []
    for number, line in enumerate(read_text(path, "IMU samples", TEXT).splitlines(), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            row = [float(word) for word in line.split(",")]
        except ValueError:
            row = []
        if len(row) != 7 or not np.isfinite(row).all():
            raise CaptureError(
                f"IMU samples '{path}', line {number}: found '{line[:80]}', expected 7 numbers: time [ns], "
                "angular velocity and acceleration about and along x, y and z"
            )
        rows.append(row)
    values = np.array(rows, np.float64).reshape(-1, 7)
    return ImuTrack(1e-9 * values[:, 0], values[:, 1:4], values[:, 4:])
