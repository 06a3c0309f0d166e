"""Bundle adjustment with a rolling shutter, against exact views of a moving camera."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from digs_warp.geometry.rigid import invert_rigid, look_at
from digs_warp.poses.from_images.rolling_shutter import (
    PIXEL_ERROR,
    RollingModel,
    RollingViews,
    _derivatives,
    _moved,
    _seen,
    adjust,
    residuals,
    walking_spins,
)
from digs_warp.poses.from_images.similarity import umeyama

READOUT = 0.02
COUNT, POINTS = 18, 200
FOCAL, WIDTH, HEIGHT = 500.0, 640, 480
SPACING = 1.2  # [s] between photographs: far longer than a shake lasts


class Walk:
    """A camera that walks round the origin at 0.2 m/s and shakes."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.spins = rng.normal(0.0, 0.1, (COUNT, 3))  # [rad/s], on top of the walk's own
        near = rng.uniform(-0.25, 0.25, (POINTS // 2, 3))
        far = rng.normal(size=(POINTS // 2, 3))
        far *= 3.0 / np.linalg.norm(far, axis=1, keepdims=True)
        self.points = np.concatenate([near, far])

    def steady(self, time: float) -> np.ndarray:
        """cam_from_world of the walk alone."""
        angle = 0.2 / 0.9 * time
        eye = 0.9 * np.array([np.cos(angle), np.sin(angle), 0.4 + 0.3 * np.sin(2 * angle)])
        return invert_rigid(look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0])))

    def pose(self, number: int, after: float) -> np.ndarray:
        """cam_from_world some time [s] after the middle row of a photograph."""
        shake = np.eye(4)
        shake[:3, :3] = Rotation.from_rotvec(self.spins[number] * after).as_matrix()
        return shake @ self.steady(SPACING * number + after)

    def views(self) -> RollingViews:
        """What a rolling shutter records: the row tells the moment, and the moment tells the row."""
        cameras, points, px = [], [], []
        for number in range(COUNT):
            for index, point in enumerate(self.points):
                moment = 0.0
                for _ in range(6):  # each brings two more digits
                    pose = self.pose(number, moment * READOUT)
                    x = pose[:3, :3] @ point + pose[:3, 3]
                    uv = FOCAL * x[:2] / x[2] + (WIDTH / 2, HEIGHT / 2)
                    # Kept in the image: rows of points outside of it are not asked for.
                    moment = float(np.clip(uv[1] / HEIGHT - 0.5, -0.5, 0.5))
                if x[2] > 0.3 and 0 < uv[0] < WIDTH and 0 < uv[1] < HEIGHT:
                    cameras.append(number)
                    points.append(index)
                    px.append(uv)
        return RollingViews(
            focals=np.full((COUNT, 2), FOCAL),
            centers=np.tile([WIDTH / 2, HEIGHT / 2], (COUNT, 1)),
            heights=np.full(COUNT, HEIGHT),
            times=SPACING * np.arange(COUNT),
            readout_time=READOUT,
            cameras=np.array(cameras),
            points=np.array(points),
            px=np.array(px),
        )

    def disturbed(self, seed: int) -> RollingModel:
        """A start with errors such as a global shutter brings, and without spins."""
        rng = np.random.default_rng(seed)
        poses = np.array([self.pose(number, 0.0) for number in range(COUNT)])
        turns = Rotation.from_rotvec(rng.normal(0.0, 0.003, (COUNT, 3))).as_matrix()
        return RollingModel(
            rotations=turns @ poses[:, :3, :3],
            translations=np.einsum("nij,nj->ni", turns, poses[:, :3, 3])
            + rng.normal(0.0, 0.003, (COUNT, 3)),
            spins=np.zeros((COUNT, 3)),
            points=self.points + rng.normal(0.0, 0.003, self.points.shape),
        )

    def center_errors(self, model: RollingModel) -> np.ndarray:
        """How far the centers [m] are from the true ones after the best alignment."""
        centers = -np.einsum("nji,nj->ni", model.rotations, model.translations)
        true = np.array([invert_rigid(self.pose(n, 0.0))[:3, 3] for n in range(COUNT)])
        return np.linalg.norm(umeyama(centers, true).apply(centers) - true, axis=1)


@pytest.fixture(scope="module")
def walk() -> Walk:
    return Walk(1)


@pytest.fixture(scope="module")
def views(walk: Walk) -> RollingViews:
    return walk.views()


def test_poses_and_spins_of_a_shaking_camera_come_back(walk: Walk, views: RollingViews) -> None:
    start = walk.disturbed(2)
    found = adjust(views, start)
    rolling = walk.center_errors(found)
    # 4 mm of travel in a read-out; what its neighbors tell of a walk that curves is not quite that.
    assert np.median(rolling) < 3e-4
    assert np.linalg.norm(residuals(views, found), axis=1).mean() < 0.03
    shake = found.spins / READOUT - walking_spins(views, found) / READOUT
    # What all spins have in common is known least.
    assert np.sqrt(((shake - walk.spins)[1:-1] ** 2).mean()) < 0.5 * walk.spins.std()


def test_without_the_spins_the_same_views_give_wrong_poses(walk: Walk, views: RollingViews) -> None:
    global_shutter = adjust(replace(views, readout_time=1e-6), walk.disturbed(2))
    right = adjust(views, walk.disturbed(2))
    wrong = np.median(walk.center_errors(global_shutter))
    assert wrong > 2.5 * np.median(walk.center_errors(right))


def test_outliers_do_not_pull(walk: Walk, views: RollingViews) -> None:
    rng = np.random.default_rng(3)
    px = views.px + rng.normal(0.0, 0.2, views.px.shape)
    wrong = rng.random(len(px)) < 0.05
    px[wrong] += rng.uniform(-30.0, 30.0, (int(wrong.sum()), 2))
    found = adjust(replace(views, px=px), walk.disturbed(2))
    assert np.median(walk.center_errors(found)) < 1e-3


def test_derivatives_are_those_of_central_differences(walk: Walk, views: RollingViews) -> None:
    model = walk.disturbed(4)
    by_image, by_point = _derivatives(views, model, _seen(views, model))
    step = 1e-6
    for column in range(9):
        steps = np.zeros((COUNT, 9))
        steps[:, column] = step
        still = np.zeros_like(model.points)
        ahead, behind = (residuals(views, _moved(model, sign * steps, still)) for sign in (1, -1))
        numeric = (ahead - behind) / (2 * step * PIXEL_ERROR)
        # What the shutter adds to them is left out: moments and travel, a hundredth.
        close = np.abs(by_image[:, :, column] - numeric).max() / np.abs(numeric).max()
        assert close < 0.03, column
    for axis in range(3):
        shift = np.zeros_like(model.points)
        shift[:, axis] = step
        ahead, behind = (
            residuals(views, replace(model, points=model.points + sign * shift)) for sign in (1, -1)
        )
        numeric = (ahead - behind) / (2 * step * PIXEL_ERROR)
        assert np.abs(by_point[:, :, axis] - numeric).max() < 0.03 * np.abs(numeric).max()
