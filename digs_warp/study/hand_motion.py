"""How a camera in a hand moves around an object, in few figures: recorded walks and simulated ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.geometry.camera import Intrinsics
from digs_warp.sim.camera.walk.settings import WalkSettings
from digs_warp.sim.camera.walk.walk import Subject, Walk

# In the sample data: once around a cabinet, a pose every 1.34 s (TUM RGB-D, fr3/cabinet).
RECORDED = "rgbd/tum_cabinet_orbit/truth_cam_poses.txt"

# Changes are taken over one, four and eight poses.
LAGS = (1, 4, 8)

# Simulated walks, each as long as the recorded one, from the same distance and height.
SEEDS = range(20)
DISTANCE, ELEVATION_DEG = 1.67, 40.0
SUBJECT = Subject(0.3, Intrinsics(width=640, height=480, fx=535.4, fy=539.2, cx=320.1, cy=247.6))


@dataclass(frozen=True, eq=False)
class TimedPoses:
    """A walk with z up.

    Attributes:
        times: [s], shape (n,).
        world_from_cam: shape (n, 4, 4).
    """

    times: np.ndarray
    world_from_cam: np.ndarray


def recorded_walk(data: Path) -> TimedPoses:
    """Return the recorded walk in the folder of the sample data."""
    from scipy.spatial.transform import Rotation

    rows = np.loadtxt(data / RECORDED)
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(rows[:, 4:8]).as_matrix()
    poses[:, :3, 3] = rows[:, 1:4]
    return TimedPoses(rows[:, 0] - rows[0, 0], poses)


def simulated_walk(times: np.ndarray, settings: WalkSettings, seed: int) -> TimedPoses:
    """Return poses of a simulated orbit at the times of a recorded one, around the origin."""
    lasting = float(times[-1]) + 1.0
    settings = WalkSettings(
        elevations=(ELEVATION_DEG,),
        duration=lasting,
        unsteadiness=settings.unsteadiness,
        shake=settings.shake,
    )
    walk = Walk.around(SUBJECT, DISTANCE, settings, seed)
    return TimedPoses(times, np.array([walk.pose(float(moment)) for moment in times]))


def figures(walk: TimedPoses) -> dict[str, float]:
    """Return RMS and changes of distance, height and aim, by name.

    The middle is the point that all lines of sight pass nearest to. Distance is relative, angles in degrees.
    """
    centers, rotations = walk.world_from_cam[:, :3, 3], walk.world_from_cam[:, :3, :3]
    to_middle = _middle(centers, rotations[:, :, 2]) - centers
    away = np.linalg.norm(to_middle, axis=1)
    x, y, z = np.einsum("nji,nj->in", rotations, to_middle)
    speed = np.linalg.norm(np.diff(centers, axis=0), axis=1) / np.diff(walk.times)
    courses = {
        "distance [%]": 100 * np.log(away),
        "elevation [degree]": np.rad2deg(np.arcsin(-to_middle[:, 2] / away)),
        "aim, across [degree]": np.rad2deg(np.arctan2(x, z)),
        "aim, up [degree]": np.rad2deg(np.arctan2(y, z)),
        "roll [degree]": np.rad2deg(np.arcsin(rotations[:, 2, 0])),
    }
    found = {}
    for name, course in courses.items():
        found[f"{name}: RMS"] = float(course.std())
        for lag in LAGS:
            change = course[lag:] - course[:-lag]
            seconds = lag * float(np.diff(walk.times).mean())
            found[f"{name}: change in {seconds:.1f} s"] = float(np.sqrt(np.mean(change**2)))
    found["speed [m/s]: mean"] = float(speed.mean())
    found["speed [%]: RMS"] = float(100 * speed.std() / speed.mean())
    return found


def simulated_figures(
    times: np.ndarray, settings: WalkSettings | None = None, seeds: Sequence[int] = SEEDS
) -> dict[str, np.ndarray]:
    """Return the figures of simulated walks by name, one value for each seed, ascending."""
    settings = settings or WalkSettings()
    each = [figures(simulated_walk(times, settings, seed)) for seed in seeds]
    return {name: np.sort([one[name] for one in each]) for name in each[0]}


def _middle(centers: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return the point nearest to lines in the mean square, (3,)."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    return np.linalg.solve(across.sum(axis=0), np.einsum("nij,nj->i", across, centers))
