"""How a camera moves while it takes a frame, as a gyroscope or a simulation tells it."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from digs_warp.record.typed import Expect

SECONDS = Expect("seconds, 0 or more", lambda value: value >= 0)

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class CameraMotion:
    """Motion of the frame's camera in the middle of its read-out, along its own axes (OpenCV).

    Attributes:
        velocity: [m/s].
        angular_velocity: [rad/s].
    """

    velocity: Triple
    angular_velocity: Triple

    @staticmethod
    def of(velocity: np.ndarray, angular_velocity: np.ndarray) -> "CameraMotion":
        """Return the motion with velocities of shape (3,)."""
        vx, vy, vz = velocity.tolist()
        wx, wy, wz = angular_velocity.tolist()
        return CameraMotion((vx, vy, vz), (wx, wy, wz))


@dataclass(frozen=True)
class Exposure:
    """What a frame of a moving camera depends on beside its pose; keys of a frame in transforms.json.

    Attributes:
        camera_motion: None: unknown.
        exposure_time: of each row [s], 0 for an instant; None: unknown.
    """

    camera_motion: CameraMotion | None = None
    exposure_time: Annotated[float | None, SECONDS] = None


UNKNOWN = Exposure()
