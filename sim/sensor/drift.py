"""How the right eye differs today from what the camera believes about it since its factory calibration.

A knock, or warm lenses, turn the right eye by small angles and change its focal length and the baseline. The
camera goes on to rectify its images and to compute depth with the old figures. A point that belongs at the
right image's pixel p then appears at

    p' ~ K' R K^-1 p

where K and K' are the matrices of the calibrated and of the drifted eye and R turns the axes of the one into
those of the other. The columns of p' shift disparity, its rows spoil the match; both depend on the place in
the image. Depth is multiplied by the old baseline over the new one.
"""

from dataclasses import dataclass, replace

import numpy as np

from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import matrix_from_rotation_vector


@dataclass(frozen=True)
class Drift:
    """What has changed since the calibration; by default nothing.

    Attributes:
        pitch_deg: turn of the right eye about its x axis, which points right [degree]; positive: upward.
        yaw_deg: about its y axis, which points down; positive: to the right.
        roll_deg: about its z axis, which points forward; positive: clockwise.
        focal: relative change of the right eye's focal length.
        baseline: relative change of the distance between the eyes.
    """

    pitch_deg: float = 0.0
    yaw_deg: float = 0.0
    roll_deg: float = 0.0
    focal: float = 0.0
    baseline: float = 0.0

    @property
    def moves_right_image(self) -> bool:
        """Whether the right eye sees its points elsewhere than the camera believes."""
        return any((self.pitch_deg, self.yaw_deg, self.roll_deg, self.focal))

    @property
    def believed_from_turned(self) -> np.ndarray:
        """The rotation from the axes of the right eye to those that the camera believes in, (3, 3)."""
        return matrix_from_rotation_vector(
            np.deg2rad([self.pitch_deg, self.yaw_deg, self.roll_deg])
        )

    def right_intrinsics(self, k: Intrinsics) -> Intrinsics:
        """Return the intrinsics of the right eye, whose calibration says ``k``."""
        return replace(k, fx=k.fx * (1 + self.focal), fy=k.fy * (1 + self.focal))

    def homography(self, k: Intrinsics) -> np.ndarray:
        """Return K' R K^-1, (3, 3): from where a point belongs in the right image [px] to where it is."""
        turned_from_believed = self.believed_from_turned.T
        return self.right_intrinsics(k).matrix @ turned_from_believed @ np.linalg.inv(k.matrix)

    def shift(
        self, columns: np.ndarray, rows: np.ndarray, k: Intrinsics
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return by how much points of the right image are displaced, to the right and down [px].

        Args:
            columns: where the points belong [px]; broadcast with ``rows``.
            rows: the same.
            k: of the calibration.
        """
        h = self.homography(k).astype(columns.dtype)
        scale = h[2, 0] * columns + (h[2, 1] * rows + h[2, 2])
        x = (h[0, 0] * columns + (h[0, 1] * rows + h[0, 2])) / scale
        y = (h[1, 0] * columns + (h[1, 1] * rows + h[1, 2])) / scale
        return x - columns, y - rows

    def shown_disparity(self, disparity: np.ndarray, k: Intrinsics) -> np.ndarray:
        """Return the disparity that the recorded pair shows.

        Args:
            disparity: true disparity of the left image [px], (height, width), float32; NaN: nothing.
            k: of the calibration.
        """
        if not self.moves_right_image:
            return disparity
        h = self.homography(k)
        rows = np.arange(k.height)[:, None] + 0.5
        columns = np.arange(k.width, dtype=np.float32) + np.float32(0.5)
        belongs = columns - disparity
        x, scale = (
            belongs * np.float32(h[i, 0]) + (h[i, 1] * rows + h[i, 2]).astype(np.float32)
            for i in (0, 2)
        )
        return columns - x / scale

    def reported_disparity(self, matched: np.ndarray) -> np.ndarray:
        """Return the disparity [px] that with today's baseline gives the depth that the camera reports."""
        return matched * np.float32(self.baseline_factor) if self.baseline else matched

    @property
    def baseline_factor(self) -> float:
        """Today's baseline over that of the calibration, in single precision."""
        return float(np.float32(1 + self.baseline))


NO_DRIFT = Drift()
