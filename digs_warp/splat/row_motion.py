"""Rolling shutter: rows are read one after another while the camera moves, so each has its own pose.

A row is read at the moment s = v / height - 1/2, in read-outs after the middle row. By then the camera has
turned and shifted, in the axes that it has at the middle row, by

    world_from_cam(s) = world_from_cam [[C(s w), s t], [0, 1]],   C(a): the rotation of quaternion (a/2, 1)

with the turn w and the shift t of a whole read-out. C turns by 2 atan(|a| / 2), which is |a| up to the third
order, and needs no trigonometry. A Gaussian is projected twice: the middle row's pose says in which row it
lies, and the pose of that row where it is seen. Its color is that of the middle row's pose.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.checks import check_finite, check_shape
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import matrix_from_quat_xyzw, rigid


@dataclass(frozen=True, eq=False)
class RowMotion:
    """How a camera moves from the first row of an image to the last, in the axes of the middle row's pose.

    Attributes:
        turn: rotation vector [rad], shape (3,).
        shift: [m], shape (3,).

    Raises:
        DigsError: another shape, or a value that is not finite.
    """

    turn: np.ndarray
    shift: np.ndarray

    def __post_init__(self) -> None:
        for name in ("turn", "shift"):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            object.__setattr__(self, name, check_finite(name, check_shape(name, value, (3,))))

    def at(self, camera: Camera, moment: float) -> Camera:
        """Return the camera at a moment, in read-outs after the middle row."""
        quat = np.append(0.5 * moment * self.turn, 1.0)
        motion = rigid(matrix_from_quat_xyzw(quat), moment * self.shift)
        return Camera(camera.intrinsics, camera.world_from_cam @ motion)


STILL = RowMotion(np.zeros(3), np.zeros(3))
