"""Camera poses that are trained with the Gaussians: each camera turns until its photograph fits.

Whenever a view is drawn, its camera turns by what lays the drawing over the photograph, see
`digs_warp.train.turns`; the next drawing of the view shows what is left. Centers stay: a shift of a camera
moves the image of an object nearly as a turn does, and the little that tells them apart is less than what the
errors of the Gaussians move.

Gaussians and cameras together may move without any change in the images. After every epoch all move back, so
that on average the cameras see the object where they saw it at first.
"""

from collections.abc import Sequence

import numpy as np

from digs_warp.camera import Camera
from digs_warp.checks import check_shape
from digs_warp.geometry import (
    PixelBox,
    invert_rigid,
    laid_over,
    matrix_from_rotation_vector,
    rigid,
    transform_points,
)
from digs_warp.train.turns import turn_between

# Share of a run after which cameras begin to turn: before, the drawings tell little.
START = 0.15
# (width of a block of pixels, visits of a view): its first comparisons use blocks, later ones single pixels.
COARSE_VISITS = ((4, 2), (2, 2))


class TrainedPoses:
    """The poses of all training views.

    Args:
        cameras: as given.
        points: of the object [m], (n, 3): the centers of the Gaussians at the start.
        steps: of the whole run.

    Attributes:
        poses: ``world_from_cam``, (n, 4, 4), float64.
    """

    def __init__(self, cameras: Sequence[Camera], points: np.ndarray, steps: int) -> None:
        given = np.stack([camera.world_from_cam for camera in cameras])
        self.poses = given.copy()
        self._cam_from_world = np.stack([invert_rigid(pose) for pose in given])
        self._visits = np.zeros(len(cameras), dtype=np.int64)
        self._first_step = int(START * steps)
        around = float(np.std(points)) * np.concatenate([np.eye(3), -np.eye(3)])
        self._marks = np.median(points, axis=0) + around

    def camera(self, index: int, camera: Camera) -> Camera:
        """Return the camera of a view, of any size, as it stands now."""
        return Camera(camera.intrinsics, self.poses[index])

    def compare(
        self,
        step: int,
        index: int,
        camera: Camera,
        drawn: np.ndarray,
        photograph: np.ndarray,
        box: PixelBox,
    ) -> None:
        """Turn a camera by what its drawing shows; the arguments are those of `turn_between`."""
        if step < self._first_step:
            return
        pool = _pool(int(self._visits[index]))
        turn = turn_between(drawn, photograph, camera.intrinsics, box, pool)
        self.poses[index] = turned(self.poses[index], turn)
        self._visits[index] += 1

    def moved_back(self) -> np.ndarray:
        """Undo what all cameras together moved the object; return that motion of the world, (4, 4)."""
        carried = np.mean(
            [
                transform_points(now @ before, self._marks)
                for now, before in zip(self.poses, self._cam_from_world, strict=True)
            ],
            axis=0,
        )
        back = laid_over(carried, self._marks)
        self.poses = back @ self.poses
        return back

    def state(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint has to hold."""
        return {"poses": self.poses, "visits": self._visits}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from `state`.

        Raises:
            DigsError: it belongs to another number of views.
        """
        count = len(self._visits)
        self.poses = check_shape("poses", state["poses"], (count, 4, 4)).copy()
        self._visits = check_shape("visits", state["visits"], (count,)).astype(np.int64)


def turned(world_from_cam: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return a pose after a turn [rad] of the camera about its center, in its own axes."""
    return world_from_cam @ rigid(matrix_from_rotation_vector(turn), np.zeros(3))


def _pool(visits: int) -> int:
    """Return the size of the blocks that the next comparison of a view takes."""
    for size, count in COARSE_VISITS:
        if visits < count:
            return size
        visits -= count
    return 1
