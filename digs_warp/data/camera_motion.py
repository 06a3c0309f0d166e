"""How a camera moves while it takes a frame, as a gyroscope or a simulation tells it."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from digs_warp.record.fields import Fields

CAMERA_MOTION, EXPOSURE_TIME = "camera_motion", "exposure_time"

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
    """What a frame of a moving camera depends on beside its pose.

    Attributes:
        motion: of the camera; None: unknown.
        exposure_time: of each row [s], 0 for an instant; None: unknown.
    """

    motion: CameraMotion | None = None
    exposure_time: float | None = None

    def as_json(self) -> dict[str, Any]:
        """Return what is known as keys of a frame in transforms.json."""
        known: dict[str, Any] = {}
        if self.motion is not None:
            known[CAMERA_MOTION] = asdict(self.motion)
        if self.exposure_time is not None:
            known[EXPOSURE_TIME] = self.exposure_time
        return known


UNKNOWN = Exposure()


def read_exposure(frame: Fields) -> Exposure:
    """Return what `Exposure.as_json` wrote into a frame.

    Raises:
        CaptureError: a value does not fit its key.
    """
    time = frame.number(EXPOSURE_TIME, 0.0, default=None, what="seconds, 0 or more")
    if CAMERA_MOTION not in frame:
        return Exposure(exposure_time=time)
    own = frame.section(CAMERA_MOTION)
    velocity, angular = (own.array(name, (3,)) for name in ("velocity", "angular_velocity"))
    return Exposure(CameraMotion.of(velocity, angular), time)
