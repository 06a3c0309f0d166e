"""The two eyes of a stereo camera, and its exposure and motion in a frame, as a capture knows them."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from digs_warp.record.typed import Expect

METRES = Expect("metres above 0", lambda value: value > 0)
PIXELS = Expect("pixels above 0", lambda value: value > 0)


@dataclass(frozen=True)
class InfraredPair:
    """Two equal infrared cameras that look the same way as the frame's camera, at its image size.

    Attributes:
        offset: place of the left one along the x axis of the frame's camera [m].
        fl_x, fl_y, cx, cy: focal lengths and principal point of either [px].
    """

    offset: float
    fl_x: Annotated[float, PIXELS]
    fl_y: Annotated[float, PIXELS]
    cx: float
    cy: float


@dataclass(frozen=True)
class Rig:
    """The two eyes from which depth is measured, side by side along the x axis of the frame's camera.

    Attributes:
        baseline: distance of the eyes [m].
        infrared: the eyes are an infrared pair beside the frame's camera; None: the left eye is that camera.
    """

    baseline: Annotated[float, METRES]
    infrared: InfraredPair | None = None


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


UNKNOWN_EXPOSURE = Exposure()
