"""Camera poses that are trained with the Gaussians: each camera moves until its photograph fits.

Whenever a view is drawn, its camera moves by what lays the drawing over the photograph (`motion_between`);
the next drawing of the view shows what is left. At first cameras only turn. Then they shift as well, in small
steps: a shift across the view moves the image of an object nearly as a turn does, and what tells them apart,
the relief of the object, is a tenth of the motion or less and comes out over many visits. Where a bundle
adjustment found the centers before (`digs_warp.poses.refine.bundle_adjustment`), they are better than that,
and cameras only turn. Gaussians and cameras together may move without any change in the images, and all may
become larger: after every epoch all move back, so that on average the cameras see the object where they saw
it at first, from as far.

With the ray (x, y, 1) of a pixel and the depth z of what it shows, a turn w [rad] and a shift t [m] of the
camera, in its own axes, move the content of the image by

    du = fx (x y wx - (1 + x^2) wy + y wz + (x tz - tx) / z)
    dv = fy ((1 + y^2) wx - x y wy - x wz + (y tz - ty) / z)

and change the image by -(I_u du + I_v dv): image registration (Lucas and Kanade, "An iterative image
registration technique", IJCAI 1981). The gradient is the mean of both images', which converges from farther
(Malis, "Improving vision-based control using efficient second-order minimization", ICRA 2004).
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import (
    PixelBox,
    invert_rigid,
    laid_over,
    matrix_from_rotation_vector,
    rigid,
    transform_points,
)

# Share of a run after which cameras begin to move: before, the drawings tell little.
START = 0.15
# Widths of the blocks of pixels that the first comparisons of a view use. Later ones use single pixels, and
# its camera shifts, too.
COARSE = (4, 4, 2, 2)
# See `motion_between`: along what a tenth of the motion tells, a visit takes half of the step.
DAMPING = 0.01

# Differences of color above this count by their size, as in L1, below by their square.
SMALL_DIFFERENCE = 0.03
# No step moves the image by more of its pixels, root mean square: beyond, its gradient tells nothing.
LARGEST_STEP = 2.0
# Standard deviation of what is expected of a motion [pixel of the image]: holds what nothing is seen of.
EXPECTED = 3.0
# Fewer pixels than this tell no motion.
LEAST_PIXELS = 64


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
        pool = next(iter(COARSE[self._visits[index] :]), 1)
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


def motion_between(
    image: np.ndarray,
    photograph: np.ndarray,
    k: Intrinsics,
    box: PixelBox,
    pool: int,
    depth: np.ndarray | None = None,
    damping: float = 0.0,
) -> np.ndarray:
    """Return the motion of the camera, (6,), by which its image lies better over the photograph.

    The motion is a turn [rad] and a shift [m] in the camera's axes, see `moved`.

    Args:
        image: what it draws, sRGB in 0..1, (height, width, 3), inside of ``box``.
        photograph: the same of the photograph.
        k: of the whole image.
        box: where in the whole image both lie [px].
        pool: width of the blocks of pixels that are averaged first; wider ones converge from farther.
        depth: of what the camera draws [m], (height, width), above 0; None: the camera only turns.
        damping: share of what the images say of a shift that is added against it: steps along what they say
            little of become shorter.
    """
    height, width = image.shape[0] // pool, image.shape[1] // pool
    if min(height, width) < 2 or height * width < LEAST_PIXELS:
        return np.zeros(6)
    first, second = pooled(image, pool), pooled(photograph, pool)
    rows, columns = np.indices(first.shape[:2])
    x = np.divide(box[0] + (columns + 0.5) * pool - k.cx, k.fx)
    y = np.divide(box[1] + (rows + 0.5) * pool - k.cy, k.fy)
    nearness = None if depth is None else pooled(1.0 / depth[..., None], pool)[..., 0]
    flow = _flow(x, y, k, nearness)  # (2, parameters, pixels)
    mean = (first + second) / 2
    down, right = np.gradient(mean, pool, axis=0), np.gradient(mean, pool, axis=1)
    difference = first - second
    weights = 1 / np.maximum(np.abs(difference), SMALL_DIFFERENCE)
    weighted_right, weighted_down = np.multiply(weights, right), np.multiply(weights, down)

    across = _over_colors(weighted_right, down)
    slopes = _over_colors(weighted_right, right), _over_colors(weighted_down, down)
    pulls = _over_colors(weighted_right, difference), _over_colors(weighted_down, difference)
    count = flow.shape[1]
    matrix, side = np.zeros((count, count)), np.zeros(count)
    # Sums, not products of matrices: those depend on the number of threads.
    for p in range(count):
        du, dv = flow[:, p]
        to_right, to_down = du * slopes[0] + dv * across, du * across + dv * slopes[1]
        for q in range(p + 1):
            matrix[p, q] = matrix[q, p] = (to_right * flow[0, q] + to_down * flow[1, q]).sum()
        side[p] = (du * pulls[0] + dv * pulls[1]).sum()
    held = np.full(count, (k.fx / (EXPECTED * pool)) ** 2)
    if nearness is not None:
        held[3:] *= float(nearness.mean()) ** 2
        held[3:] += damping * np.diag(matrix)[3:]
    motion = np.linalg.solve(matrix + np.diag(held), side)
    moves = np.einsum("dpn,p->dn", flow, motion)
    step = float(np.sqrt((moves**2).sum(axis=0).mean()))
    motion *= min(1.0, LARGEST_STEP * pool / max(step, 1e-12))
    return np.concatenate([motion, np.zeros(6 - count)])


def _over_colors(values: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return sums of products over the channels, flat."""
    return np.einsum("ijc,ijc->ij", values, others).ravel()


def moved(world_from_cam: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Return a pose after a turn [rad] about its center and a shift [m], both in its own axes, (6,)."""
    return world_from_cam @ rigid(matrix_from_rotation_vector(motion[:3]), motion[3:])


def _flow(x: np.ndarray, y: np.ndarray, k: Intrinsics, nearness: np.ndarray | None) -> np.ndarray:
    """Return how each parameter of a motion moves the content [px], (2, parameters, pixels)."""
    nothing = np.zeros_like(x)
    right = [x * y, -(1 + x * x), y]
    down = [1 + y * y, -x * y, -x]
    if nearness is not None:
        right += [-nearness, nothing, x * nearness]
        down += [nothing, -nearness, y * nearness]
    both = np.stack([k.fx * np.stack(right), k.fy * np.stack(down)])
    return both.reshape(*both.shape[:2], -1)


def pooled(image: np.ndarray, size: int) -> np.ndarray:
    """Return means of blocks of ``size`` x ``size`` pixels; an incomplete last row or column drops out."""
    if size == 1:
        return image
    height, width = image.shape[0] // size, image.shape[1] // size
    blocks = image[: height * size, : width * size].reshape(height, size, width, size, -1)
    return blocks.mean(axis=(1, 3))


# What cameras do: stay where they are, turn, or turn and shift.
PoseTraining = Literal["held", "turned", "moved"]
