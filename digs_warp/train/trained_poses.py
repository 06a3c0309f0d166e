"""Camera poses that are trained with the Gaussians: each camera moves until its photograph fits.

Whenever a view is drawn, its camera moves by what lays the drawing over the photograph, see
`digs_warp.train.registration`; the next drawing of the view shows what is left. At first cameras only turn.
Then they shift as well, in small steps: a shift across the view moves the image of an object nearly as a turn
does, and the little that tells them apart comes out over many visits. Where a bundle adjustment found the
centers before (`digs_warp.poses.bundle`), they are better than that, and cameras only turn.

Gaussians and cameras together may move without any change in the images, and all may become larger. After
every epoch all move back, so that on average the cameras see the object where they saw it at first, from as
far.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import (
    PixelBox,
    invert_rigid,
    laid_over,
    transform_points,
)
from digs_warp.train.registration import motion_between, moved

# What cameras do: stay where they are, turn, or turn and shift.
PoseTraining = Literal["held", "turned", "moved"]

# Share of a run after which cameras begin to move: before, the drawings tell little.
START = 0.15
# (width of a block of pixels, visits of a view): its first comparisons use blocks. Later ones use single
# pixels, and its camera shifts, too.
COARSE_VISITS = ((4, 2), (2, 2))
# See `motion_between`: along what a tenth of the motion tells, a visit takes half of the step.
DAMPING = 0.01


class TrainedPoses:
    """The poses of all training views.

    Args:
        cameras: as given.
        points: of the object [m], (n, 3): the centers of the Gaussians at the start.
        steps: of the whole run.
        shifts: whether cameras shift as well as turn.

    Attributes:
        poses: ``world_from_cam``, (n, 4, 4), float64.
        shifts: as given.
    """

    def __init__(
        self, cameras: Sequence[Camera], points: np.ndarray, steps: int, shifts: bool = True
    ) -> None:
        given = np.stack([camera.world_from_cam for camera in cameras])
        self.poses = given.copy()
        self._cam_from_world = np.stack([invert_rigid(pose) for pose in given])
        self._visits = np.zeros(len(cameras), dtype=np.int64)
        self._first_step = int(START * steps)
        self.shifts = shifts
        around = float(np.std(points)) * np.concatenate([np.eye(3), -np.eye(3)])
        self._middle = np.median(points, axis=0)
        self._marks = self._middle + around
        self._distance = self._mean_distance()

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
        depth: np.ndarray | None = None,
    ) -> None:
        """Move a camera by what its drawing shows; the arguments are those of `motion_between`.

        ``depth``: 0 where little is drawn. Default: that of the middle of the object everywhere.
        """
        if step < self._first_step:
            return
        pool = _pool(int(self._visits[index]))
        pose = self.poses[index]
        seen = None
        if pool == 1 and self.shifts:
            seen = filled_depth(depth, drawn.shape[:2], pose, self._middle)
        k = camera.intrinsics
        motion = motion_between(drawn, photograph, k, box, pool, seen, DAMPING)
        self.poses[index] = moved(pose, motion)
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
        away = self.poses[:, :3, 3] - self._middle
        self.poses[:, :3, 3] = self._middle + away * self._distance / self._mean_distance()
        return back

    def _mean_distance(self) -> float:
        """Return the mean distance of the cameras from the middle of the object [m]."""
        return float(np.linalg.norm(self.poses[:, :3, 3] - self._middle, axis=1).mean())

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


def filled_depth(
    depth: np.ndarray | None, shape: tuple[int, ...], world_from_cam: np.ndarray, middle: np.ndarray
) -> np.ndarray:
    """Return the depth of a view [m], (height, width), where it is 0 that of the middle of the object."""
    usual = max(float((middle - world_from_cam[:3, 3]) @ world_from_cam[:3, 2]), 1e-6)
    return np.full(shape, usual) if depth is None else np.where(depth > 0, depth, usual)


def _pool(visits: int) -> int:
    """Return the size of the blocks that the next comparison of a view takes."""
    for size, count in COARSE_VISITS:
        if visits < count:
            return size
        visits -= count
    return 1
