"""Motion blur: a camera moves while its shutter is open, so an image is the mean of views along the way.

An exposure is drawn as the mean of n views, each from the pose of its moment,

    image = (1 / n) sum_i view(world_from_cam M(t_i)),   t_i = ((i + 1/2) / n - 1/2) / sqrt(1 - 1 / n^2)

with t in exposures after its middle, and M(t) the motion over a whole exposure, as in
`digs_warp.splat.row_motion`. The moments lie a little further apart than the middles of n equal parts: their
variance is 1/12, that of an exposure, so that few moments blur an edge as much as the exposure does. (Two and
three of them integrate polynomials of degree 3 exactly: Chebyshev's quadrature.) The mean is that of the sRGB
values, as everywhere in splatting; a camera's is that of the light.
"""

from dataclasses import dataclass
from math import ceil, sqrt

from digs_warp.geometry.camera import Camera
from digs_warp.splat.row_motion import RowMotion

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
