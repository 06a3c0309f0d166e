"""How a camera moves while it takes an image: over its rows (rolling shutter), and while each is exposed.

A row is read at the moment s = v / height - 1/2, in read-outs after the middle row. By then the camera has
turned and shifted, in the axes that it has at the middle row, by

    world_from_cam(s) = world_from_cam M(s),   M(s) = [[C(s w), s t], [0, 1]]

with the turn w and the shift t of a whole read-out, and the rotation C(a) of quaternion (a/2, 1). C turns by
2 atan(|a| / 2), which is |a| up to the third order, and needs no trigonometry. A Gaussian is projected twice:
the middle row's pose says in which row it lies, and the pose of that row where it is seen. Its color is that
of the middle row's pose.

An exposure is drawn as the mean of n views, each from the pose of its moment,

    image = (1 / n) sum_i view(world_from_cam M(t_i)),   t_i = ((i + 1/2) / n - 1/2) / sqrt(1 - 1 / n^2)

with t in exposures after its middle, and the turn and shift of a whole exposure. The moments lie a little
further apart than the middles of n equal parts: their variance is 1/12, that of an exposure, so that few
moments blur an edge as much as the exposure does. (Two and three of them integrate polynomials of degree 3
exactly: Chebyshev's quadrature.) The mean is that of the sRGB values, as everywhere in splatting; a camera's
is that of the light.
"""

from dataclasses import dataclass
from math import ceil, sqrt

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

# Less blur [px] than this is that of a pixel itself.
LEAST_BLUR = 0.5
# Moments may lie this far apart [px]: neighboring pixels then still overlap.
SPACING = 1.0
MOST_MOMENTS = 8


@dataclass(frozen=True, eq=False)
class Blur:
    """How a camera moves while the shutter is open.

    Attributes:
        motion: over the whole exposure, in the axes of the camera in its middle.
        pixels: how far the image moves meanwhile [px].
    """

    motion: RowMotion
    pixels: float

    @property
    def moments(self) -> int:
        """How many views the image is the mean of: 1 where it hardly moves."""
        if self.pixels < LEAST_BLUR:
            return 1
        return min(max(2, ceil(self.pixels / SPACING)), MOST_MOMENTS)

    def cameras(self, camera: Camera) -> list[Camera]:
        """Return the cameras of all moments, the one nearest to the middle of the exposure first."""
        count = self.moments
        if count == 1:
            return [camera]
        steps = sorted(range(1 - count, count, 2), key=abs)  # half steps from the middle
        step = 1.0 / sqrt(count**2 - 1.0)
        return [self.motion.at(camera, 0.5 * step * each) for each in steps]
