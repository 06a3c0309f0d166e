"""Bundle adjustment for cameras that read their rows one after another while they move, of COLMAP's models.

COLMAP takes every image for one moment. A hand that walks and shakes bends each image by a pixel or two,
and COLMAP pays for that with poses that are wrong by millimetres. Here an image has, beside the pose in the
middle of its read-out, its own spin: a hand shakes too fast to infer it from neighboring photographs. How
the camera travels meanwhile is taken from the poses of its neighbors. A point seen in the row v of an image
of h rows lies at

    x = R(tau w) (R X + t) + tau n,    tau = v / h - 1/2,

with the spin w [rad per read-out] and the travel n [SfM units per read-out]. (Hedborg et al., "Rolling
shutter bundle adjustment", CVPR 2012, interpolate both between the frames of a video.)

Spins that all images share look like another focal length or a bent scene. So a spin is expected to be that
of the walk, give or take a hand's shake.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.sfm_model import SfmModel
from digs_warp.geometry.reproject import Pinholes, project
from digs_warp.geometry.rigid import invert_rigid, matrix_from_rotation_vector
from digs_warp.poses.from_images.colmap import ImageSet, quiet_pycolmap
from digs_warp.poses.from_images.model import sfm_model

# How fast a hand's shake turns a camera, RMS per axis [rad/s]; measured walks have 0.15 in all.
HAND_SHAKE = 0.1

# Error of a feature's position [px]; larger ones count less and less (Cauchy's weights).
PIXEL_ERROR = 0.5

MAX_STEPS = 15
# Share by which the cost has to fall in a step for another one to follow.
LEAST_GAIN = 5e-3
DAMPING = 1e-6
MOST_DAMPING = 1e3

# Unknowns of an image: turn and shift of its pose, and its spin.
_WIDTH = 9


@dataclass(frozen=True, eq=False)
class RollingViews:
    """Where n images saw m points.

    Attributes:
        focals: focal lengths [px], shape (n, 2).
        centers: principal points [px], shape (n, 2).
        heights: number of rows, shape (n,).
        times: when the middle row was read [s], ascending, shape (n,).
        readout_time: from the first to the last row [s], above 0.
        cameras: image of each of k observations, ascending, shape (k,).
        points: point of each observation, shape (k,).
        px: where it was seen, shape (k, 2).
    """

    focals: np.ndarray
    centers: np.ndarray
    heights: np.ndarray
    times: np.ndarray
    readout_time: float
    cameras: np.ndarray
    points: np.ndarray
    px: np.ndarray

    @property
    def moments(self) -> np.ndarray:
        """When each observation was read, in read-outs after the middle row, shape (k,)."""
        return self.px[:, 1] / self.heights[self.cameras] - 0.5


@dataclass(frozen=True, eq=False)
class RollingModel:
    """Poses in the middle of the read-out, spins and points; float64.

    Attributes:
        rotations: cam-from-world, shape (n, 3, 3).
        translations: cam-from-world, shape (n, 3).
        spins: rotation vectors in the camera's axes [rad per read-out], shape (n, 3).
        points: shape (m, 3).
    """

    rotations: np.ndarray
    translations: np.ndarray
    spins: np.ndarray
    points: np.ndarray


def adjust(views: RollingViews, start: RollingModel) -> RollingModel:
    """Return the model that fits the observations best, from a start that took the shutter for global.

    Levenberg-Marquardt with the points eliminated (Schur complement).
    """
    model, damping = start, DAMPING
    cost = _cost(views, model)
    for _ in range(MAX_STEPS):
        equations = _Equations.of(views, model)
        while damping <= MOST_DAMPING:
            tried = _moved(model, *equations.solve(damping))
            found = _cost(views, tried)
            if found < cost:
                break
            damping *= 10
        else:
            return model
        gain, model, cost, damping = cost - found, tried, found, max(DAMPING, damping / 10)
        if gain < LEAST_GAIN * cost:
            break
    return model


def residuals(views: RollingViews, model: RollingModel) -> np.ndarray:
    """Return where the model sees the points, less where they were seen [px], shape (k, 2)."""
    return _project(views, _seen(views, model)) - views.px


def walking_spins(views: RollingViews, model: RollingModel) -> np.ndarray:
    """Return how the neighboring poses say that each camera turns [rad per read-out], shape (n, 3)."""
    from scipy.spatial.transform import Rotation

    before, after, share = _neighbors(views)
    turns = model.rotations[after] @ model.rotations[before].transpose(0, 2, 1)
    return Rotation.from_matrix(turns).as_rotvec() * share[:, None]


def _travel(views: RollingViews, model: RollingModel) -> np.ndarray:
    """Return how the world shifts in each camera's axes during a read-out, (n, 3)."""
    before, after, share = _neighbors(views)
    centers = -np.einsum("nji,nj->ni", model.rotations, model.translations)
    shift = (centers[after] - centers[before]) * share[:, None]
    return -np.einsum("nij,nj->ni", model.rotations, shift)


def _neighbors(views: RollingViews) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the image before and after each, and the share of a read-out in the time between them."""
    index = np.arange(len(views.times))
    before, after = np.maximum(index - 1, 0), np.minimum(index + 1, len(index) - 1)
    return before, after, views.readout_time / (views.times[after] - views.times[before])


def _seen(views: RollingViews, model: RollingModel) -> np.ndarray:
    """Return the points in the axes of the cameras at the moments they were read, (k, 3)."""
    own, moments = views.cameras, views.moments[:, None]
    still = np.einsum("kij,kj->ki", model.rotations[own], model.points[views.points])
    still += model.translations[own]
    # Two terms of the series: a read-out turns by a hundredth of a radian at most.
    turn = moments * model.spins[own]
    once = np.cross(turn, still)
    return still + once + 0.5 * np.cross(turn, once) + moments * _travel(views, model)[own]


def _project(views: RollingViews, seen: np.ndarray) -> np.ndarray:
    own = views.cameras
    (fx, fy), (cx, cy) = views.focals[own].T, views.centers[own].T
    u, v, _ = project(seen, Pinholes(np.empty(0), views.heights, fx, fy, cx, cy))
    return np.stack([u, v], axis=1)


def _cost(views: RollingViews, model: RollingModel) -> float:
    """Return the sum that is minimized: Cauchy's function of the errors, and the unexpected spins."""
    error = residuals(views, model) / PIXEL_ERROR
    surprise = _surprise(views, model)
    return float(np.log1p((error**2).sum(axis=1)).sum() + (surprise**2).sum())


def _surprise(views: RollingViews, model: RollingModel) -> np.ndarray:
    """Return how far spins are from those of the walk, in units of a hand's shake."""
    expected = walking_spins(views, model)
    return (model.spins - expected) / (HAND_SHAKE * views.readout_time)


def _moved(model: RollingModel, steps: np.ndarray, shifts: np.ndarray) -> RollingModel:
    turns = np.array([matrix_from_rotation_vector(step[:3]) for step in steps])
    return replace(
        model,
        rotations=turns @ model.rotations,
        translations=np.einsum("nij,nj->ni", turns, model.translations) + steps[:, 3:6],
        spins=model.spins + steps[:, 6:],
        points=model.points + shifts,
    )


@dataclass(frozen=True, eq=False)
class _Equations:
    """The normal equations, in blocks: of images (n, 9, 9), of points (m, 3, 3), and of both (k, 9, 3)."""

    of_images: np.ndarray
    of_points: np.ndarray
    of_both: np.ndarray
    images: np.ndarray
    points: np.ndarray
    image_side: np.ndarray
    point_side: np.ndarray

    @staticmethod
    def of(views: RollingViews, model: RollingModel) -> "_Equations":
        n, m = len(views.times), len(model.points)
        seen = _seen(views, model)
        error = (_project(views, seen) - views.px) / PIXEL_ERROR
        weight = 1.0 / (1.0 + (error**2).sum(axis=1))
        by_image, by_point = _derivatives(views, model, seen)
        of_images = _summed(
            np.einsum("k,kri,krj->kij", weight, by_image, by_image), views.cameras, n
        )
        image_side = -_summed(np.einsum("k,kri,kr->ki", weight, by_image, error), views.cameras, n)
        sharpness = 1.0 / (HAND_SHAKE * views.readout_time)
        of_images[:, 6:, 6:] += sharpness**2 * np.eye(3)
        image_side[:, 6:] -= sharpness * _surprise(views, model)
        return _Equations(
            of_images,
            _summed(np.einsum("k,kri,krj->kij", weight, by_point, by_point), views.points, m),
            np.einsum("k,kri,krj->kij", weight, by_image, by_point),
            *(views.cameras, views.points, image_side),
            -_summed(np.einsum("k,kri,kr->ki", weight, by_point, error), views.points, m),
        )

    def solve(self, damping: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the steps of the images, (n, 9), and of the points, (m, 3)."""
        from scipy.linalg import cho_factor, cho_solve
        from scipy.sparse import bsr_array

        n, m = len(self.of_images), len(self.of_points)
        inverse = np.linalg.inv(_damped(self.of_points, damping))
        # One block a row and observation; points eliminated: S = U - W V^-1 W^T.
        starts = np.searchsorted(self.images, np.arange(n + 1))
        shape = (_WIDTH * n, 3 * m)
        both = bsr_array((self.of_both, self.points, starts), shape=shape)
        scaled = bsr_array((self.of_both @ inverse[self.points], self.points, starts), shape=shape)
        reduced = -(scaled @ both.T).toarray()
        blocks = reduced.reshape(n, _WIDTH, n, _WIDTH)
        blocks[np.arange(n), :, np.arange(n), :] += _damped(self.of_images, damping)
        side = self.image_side.ravel() - scaled @ self.point_side.ravel()
        steps = cho_solve(cho_factor(reduced), side)
        rest = self.point_side - (both.T @ steps).reshape(m, 3)
        return steps.reshape(n, _WIDTH), np.einsum("mij,mj->mi", inverse, rest)


def _derivatives(
    views: RollingViews, model: RollingModel, seen: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives of the errors by the image, (k, 2, 9), and by the point, (k, 2, 3).

    How far a camera turns while it reads is left out of them: a hundredth at most, and steps are repeated.
    """
    focals = views.focals[views.cameras] / (PIXEL_ERROR * seen[:, 2:])
    by_seen = np.zeros((len(seen), 2, 3))
    by_seen[:, 0, 0], by_seen[:, 1, 1] = focals.T
    by_seen[:, :, 2] = -focals * seen[:, :2] / seen[:, 2:]
    # Row times (turn x seen) = turn times (seen x row).
    by_turn = np.cross(seen[:, None], by_seen)
    by_image = np.concatenate([by_turn, by_seen, views.moments[:, None, None] * by_turn], axis=2)
    return by_image, by_seen @ model.rotations[views.cameras]


def _summed(values: np.ndarray, index: np.ndarray, count: int) -> np.ndarray:
    """Return the sums of the rows with the same index."""
    flat = values.reshape(len(values), -1)
    columns = [np.bincount(index, weights=column, minlength=count) for column in flat.T]
    return np.stack(columns, axis=1).reshape(count, *values.shape[1:])


def _damped(blocks: np.ndarray, damping: float) -> np.ndarray:
    """Return blocks with larger diagonals: seven unknowns (place, turn, size) are nobody's."""
    diagonal = np.einsum("nii->ni", blocks)
    damped = blocks.copy()
    np.einsum("nii->ni", damped)[:] += damping * diagonal + 1e-12
    return damped


def correct_rolling_shutter(
    reconstruction: Any, frames: Sequence[Frame], images: ImageSet, readout_time: float
) -> None:
    """Change poses and points of a model to those that fit images read row after row.

    Poses become those of the middle rows. Where features were measured stays as it is; the errors of the
    points are those that are left with the shutter taken into account.

    Args:
        reconstruction: a pycolmap.Reconstruction of these images.
        frames: all frames of the recording; their times have to rise.
        images: their names in COLMAP.
        readout_time: from the first to the last row [s], above 0.

    Raises:
        DigsError: times that do not rise.
    """
    model = sfm_model(reconstruction, frames, images)
    views = _views(model, frames, readout_time)
    adjusted = adjust(views, _start(views, model))
    errors = np.linalg.norm(residuals(views, adjusted), axis=1)
    _write_poses(reconstruction, dict(zip(images.names, frames, strict=True)), model, adjusted)
    _write_points(reconstruction, views, adjusted, errors)


def _views(model: SfmModel, frames: Sequence[Frame], readout_time: float) -> RollingViews:
    time_of = {frame.name: frame.time for frame in frames}
    times = np.array([time_of[name] for name in model.names])
    if not (np.diff(times) > 0).all():
        first = int(np.argmin(np.diff(times) > 0))
        raise DigsError(
            f"structure from motion: image '{model.names[first + 1]}' was taken at {times[first + 1]:g} s, "
            f"expected later than '{model.names[first]}' at {times[first]:g} s; correct the times of the "
            "recording, or give 0 for --readout-time"
        )
    intrinsics = [camera.intrinsics for camera in model.cameras]
    return RollingViews(
        focals=np.array([(k.fx, k.fy) for k in intrinsics]),
        centers=np.array([(k.cx, k.cy) for k in intrinsics]),
        heights=np.array([k.height for k in intrinsics]),
        times=times,
        readout_time=readout_time,
        cameras=model.observations.cameras,
        points=model.observations.points,
        px=model.observations.px.astype(np.float64),
    )


def _start(views: RollingViews, model: SfmModel) -> RollingModel:
    cams_from_world = np.array([invert_rigid(camera.world_from_cam) for camera in model.cameras])
    still = RollingModel(
        rotations=cams_from_world[:, :3, :3],
        translations=cams_from_world[:, :3, 3],
        spins=np.zeros((len(cams_from_world), 3)),
        points=model.points.points_world.astype(np.float64),
    )
    return replace(still, spins=walking_spins(views, still))


def _write_poses(
    reconstruction: Any, frame_of: dict[str, Frame], model: SfmModel, adjusted: RollingModel
) -> None:
    pycolmap = quiet_pycolmap()
    number = {name: index for index, name in enumerate(model.names)}
    for image in reconstruction.images.values():
        if not image.has_pose:
            continue
        index = number[frame_of[image.name].name]
        pose = np.column_stack([adjusted.rotations[index], adjusted.translations[index]])
        image.frame.set_cam_from_world(image.camera_id, pycolmap.Rigid3d(pose))


def _write_points(
    reconstruction: Any, views: RollingViews, adjusted: RollingModel, errors: np.ndarray
) -> None:
    count = len(adjusted.points)
    means = np.bincount(views.points, weights=errors, minlength=count)
    means /= np.maximum(1, np.bincount(views.points, minlength=count))
    for index, key in enumerate(sorted(reconstruction.points3D)):  # the order of `sfm_model`
        reconstruction.points3D[key].xyz = adjusted.points[index]
        reconstruction.points3D[key].error = float(means[index])
