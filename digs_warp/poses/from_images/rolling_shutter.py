"""COLMAP's models of cameras that read their rows one after another while they move, corrected.

COLMAP takes every image for one moment. A hand that walks and shakes bends each image by a pixel or two,
and COLMAP pays for that with poses that are wrong by millimetres. Here an image has, beside the pose in the
middle of its read-out, its own spin: a hand shakes too fast to infer it from neighboring photographs. How
the camera travels meanwhile is taken from the poses of its neighbors. A point seen in the row v of an image
of h rows lies at

    x = R(tau w) (R X + t) + tau n,    tau = v / h - 1/2,

with the spin w [rad per read-out] and the travel n [SfM units per read-out]. (Hedborg et al., "Rolling
shutter bundle adjustment", CVPR 2012, interpolate both between the frames of a video.)

In turns, features move to where the middle row would have shown them, COLMAP adjusts poses and points to
these, and spins are fitted to what is left. Spins that all images share look like another focal length or a
bent scene. So a spin is expected to be that of the walk, give or take a hand's shake.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.geometry.rigid import rigid
from digs_warp.poses.from_images.colmap import ImageSet, quiet_pycolmap

# How fast a hand's shake turns a camera, RMS per axis [rad/s]; measured walks have 0.15 in all.
HAND_SHAKE = 0.1
# Error of a feature's position [px]; larger ones count less and less (Cauchy's weights).
PIXEL_ERROR = 0.5
# Times that features, poses and spins are found in turn, and steps of COLMAP's adjustment each time.
ROUNDS, STEPS = 20, 2
# Spins move this much farther than each alone asks for: points follow them slowly.
FURTHER = 1.5


class _RollingView:
    """An image of a model: what it sees, and how it moves.

    Args:
        image: of pycolmap, with a pose.
        row_of: the row of each point of the model in an array of all.

    Attributes:
        rows: of what it sees, (k,).
        px: where it was seen, (k, 2).
        spin: [rad per read-out], (3,).
        travel: how the world shifts in the axes of the camera during a read-out, (3,).
    """

    def __init__(self, image: Any, row_of: dict[int, int]) -> None:
        self._image = image
        self._numbers = [int(n) for n in image.get_observation_point2D_idxs()]
        self.rows = np.array([row_of[image.points2D[n].point3D_id] for n in self._numbers], int)
        self.px = np.array([image.points2D[n].xy for n in self._numbers]).reshape(-1, 2)
        k = image.camera
        self._focal, self._center = np.array(k.params[:2]), np.array(k.params[2:4])
        self._moments = (self.px[:, 1] / k.height - 0.5)[:, None]
        self.spin = self.travel = np.zeros(3)

    @property
    def pose(self) -> np.ndarray:
        """``cam_from_world`` of the middle row, (4, 4)."""
        pose = self._image.cam_from_world()
        return rigid(pose.rotation.matrix(), pose.translation)

    def _still(self, points: np.ndarray) -> np.ndarray:
        """Return what it sees of all points, in the axes of the middle row, (k, 3)."""
        pose = self.pose
        return points[self.rows] @ pose[:3, :3].T + pose[:3, 3]

    def _rolled(self, still: np.ndarray) -> np.ndarray:
        """Return the points in the axes of the camera when it reads them, (k, 3)."""
        # Two terms of the series: a read-out turns by a hundredth of a radian at most.
        turn = self._moments * self.spin
        once = np.cross(turn, still)
        return still + once + 0.5 * np.cross(turn, once) + self._moments * self.travel

    def _shown(self, points: np.ndarray) -> np.ndarray:
        return points[:, :2] / points[:, 2:] * self._focal + self._center

    def straighten(self, points: np.ndarray) -> None:
        """Move the features to where the middle row would have shown them."""
        still = self._still(points)
        self.measure(self.px - self._shown(self._rolled(still)) + self._shown(still))

    def measure(self, px: np.ndarray) -> None:
        """Put the features at pixels, (k, 2)."""
        features = self._image.points2D
        for number, place in zip(self._numbers, px, strict=True):
            features[number].xy = place

    def fit_spin(self, points: np.ndarray, expected: np.ndarray, shake: float) -> None:
        """Fit the spin, together with a motion that COLMAP finds again; ``shake``: how far it may be off."""
        seen = self._rolled(self._still(points))
        error = (self._shown(seen) - self.px) / PIXEL_ERROR
        weight = 1.0 / (1.0 + (error**2).sum(axis=1))
        focal = self._focal / (PIXEL_ERROR * seen[:, 2:])
        by_seen = np.zeros((len(seen), 2, 3))
        by_seen[:, 0, 0], by_seen[:, 1, 1] = focal.T
        by_seen[:, :, 2] = -focal * seen[:, :2] / seen[:, 2:]
        # Row times (turn x seen) = turn times (seen x row).
        by_turn = np.cross(seen[:, None], by_seen)
        slopes = np.concatenate([self._moments[..., None] * by_turn, by_turn, by_seen], axis=2)
        held = np.diag([shake**-2] * 3 + [1e-9] * 6)
        matrix = np.einsum("k,kri,krj->ij", weight, slopes, slopes) + held
        side = -np.einsum("k,kri,kr->i", weight, slopes, error)
        side[:3] -= (self.spin - expected) / shake**2
        self.spin = self.spin + FURTHER * np.linalg.solve(matrix, side)[:3]


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
    posed = {image.name: image for image in reconstruction.images.values() if image.has_pose}
    placed = [each for each in zip(frames, images.names, strict=True) if each[1] in posed]
    times = _rising_times([frame for frame, _ in placed])
    keys = list(reconstruction.points3D)
    row_of = {key: row for row, key in enumerate(keys)}
    views = [_RollingView(posed[name], row_of) for _, name in placed]

    def points() -> np.ndarray:
        return np.array([reconstruction.points3D[key].xyz for key in keys]).reshape(-1, 3)

    for view, spin in zip(views, _moved_as_neighbors(views, times, readout_time), strict=True):
        view.spin = spin
    for _ in range(ROUNDS):
        before = points()
        for view in views:
            view.straighten(before)
        _adjust(reconstruction)
        after, expected = points(), _moved_as_neighbors(views, times, readout_time)
        for view, spin in zip(views, expected, strict=True):
            view.fit_spin(after, spin, HAND_SHAKE * readout_time)
    found = points()
    for view in views:
        view.straighten(found)
    reconstruction.update_point_3d_errors()
    for view in views:
        view.measure(view.px)


def _rising_times(frames: Sequence[Frame]) -> np.ndarray:
    """Return when the middle rows were read [s], (n,)."""
    for before, after in pairwise(frames):
        if not after.time > before.time:
            raise DigsError(
                f"structure from motion: image '{after.name}' was taken at {after.time:g} s, expected later "
                f"than '{before.name}' at {before.time:g} s; correct the times of the recording, or give 0 "
                "for --readout-time"
            )
    return np.array([frame.time for frame in frames])


def _moved_as_neighbors(
    views: Sequence[_RollingView], times: np.ndarray, readout_time: float
) -> np.ndarray:
    """Set how the views travel, and return how they turn [rad per read-out], (n, 3), by their neighbors."""
    from scipy.spatial.transform import Rotation

    poses = np.array([view.pose for view in views])
    centers = -np.einsum("nji,nj->ni", poses[:, :3, :3], poses[:, :3, 3])
    index = np.arange(len(views))
    before, after = np.maximum(index - 1, 0), np.minimum(index + 1, len(index) - 1)
    share = (readout_time / (times[after] - times[before]))[:, None]
    travel = np.einsum("nij,nj->ni", poses[:, :3, :3], (centers[after] - centers[before]) * share)
    for view, each in zip(views, travel, strict=True):
        view.travel = -each
    turns = poses[after, :3, :3] @ poses[before, :3, :3].transpose(0, 2, 1)
    return Rotation.from_matrix(turns).as_rotvec() * share


def _adjust(reconstruction: Any) -> None:
    pycolmap = quiet_pycolmap()
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length = options.refine_extra_params = options.print_summary = False
    options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.loss_function_scale = PIXEL_ERROR
    options.ceres.solver_options.max_num_iterations = STEPS
    config = pycolmap.BundleAdjustmentConfig()
    for image in reconstruction.reg_image_ids():
        config.add_image(image)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    pycolmap.create_default_bundle_adjuster(options, config, reconstruction).solve()
