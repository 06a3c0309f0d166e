"""A camera carried around an object by hand: a path, with the slow wander and the shake of a hand."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from digs_warp.checks import DigsError, check_positive
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import invert_rigid, look_at, matrix_from_rotation_vector, rigid
from digs_warp.sim.camera.walk.hand_motion import (
    AIM_LIMIT,
    AIM_RMS_DEG,
    PEAK,
    POSITION_SHAKE,
    SAMPLE_RATE,
    distance_limits,
    shake_tracks,
    wander,
)
from digs_warp.sim.camera.walk.paths import Path, path_named, place, room
from digs_warp.sim.camera.walk.settings import HOVERING, WalkSettings

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

# Camera motion counts as constant over this time [s]: about the longest exposure or read-out of a frame.
MOTION_SPAN = 1.0 / 30.0

# A camera stays this share of its distance above the ground, and the peaks of its shake.
CLEARANCE = 0.03

# Over this share of the distance, a hand that comes too near to the ground is stopped.
STOPPING = 0.02

# The steepest elevation that the wander reaches [rad]: straight above, a camera that looks down has no up.
STEEPEST = np.deg2rad(86.0)

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Subject:
    """What the camera is aimed at, around the origin.

    Attributes:
        radius: of its bounding sphere [m].
        intrinsics: of the images in which it should stay.
        ground: height of what it stands on [m]; None: nothing is below.
        baseline: how far to the right of the aimed eye another one takes images [m]; 0: there is none.
    """

    radius: float
    intrinsics: Intrinsics
    ground: float | None = None
    baseline: float = 0.0


@dataclass(frozen=True, eq=False)
class Walk:
    """A walk as a function of time, sampled at SAMPLE_RATE.

    Attributes:
        times: of the samples [s], ascending from 0, shape (n,).
        eyes: positions without shake, in the world [m], shape (n, 3).
        offsets: shake of the position, in the camera's axes [m], shape (n, 3).
        turns: shake and drift of the direction, rotation vectors in the camera's axes [rad], shape (n, 3).
        nearest: the camera comes no nearer to the origin [m], but for its shake.
        farthest: nor does it go farther away [m].
    """

    times: np.ndarray
    eyes: np.ndarray
    offsets: np.ndarray
    turns: np.ndarray
    nearest: float
    farthest: float

    @staticmethod
    def around(
        subject: Subject,
        distance: float,
        settings: WalkSettings,
        seed: int = 0,
    ) -> "Walk":
        """Return a walk around the origin.

        Args:
            subject: what to look at.
            distance: of the path from the origin, without wander [m].
            settings: where to, and how steadily.
            seed: of shake and wander.

        Raises:
            DigsError: the path leads into the ground.
        """
        check_positive("distance of the camera", distance)
        path = path_named(settings.path, np.deg2rad(settings.chosen_elevations))
        _check_above_ground(path, distance, subject, settings)
        end = settings.duration or _usual_duration(path, distance, settings.speed)
        # Four samples at least: fewer make no curve.
        times = np.arange(max(4, int(end * SAMPLE_RATE + 1e-6) + 1)) / SAMPLE_RATE
        walked = path.walked(times, settings.speed / distance)
        straying = wander(len(times), seed, settings.unsteadiness)
        reach = distance * walked.reach * np.exp(straying.nearness)
        elevation = np.clip(walked.elevation + straying.upward, -STEEPEST, STEEPEST)
        eyes = place(walked.azimuth + straying.sideways, elevation, reach)
        lowest = _lowest_eye(distance, subject, settings)
        if lowest is not None:
            eyes[:, 2] = _kept_above(eyes[:, 2], lowest, STOPPING * distance)
        offsets, turns_deg = shake_tracks(len(times), np.random.SeedSequence(seed))
        drift = straying.aim * _aim_rms(subject, eyes, settings)
        nearest, farthest = distance_limits(settings.unsteadiness)
        return Walk(
            times=times,
            eyes=eyes,
            offsets=settings.shake * offsets,
            turns=settings.shake * np.deg2rad(turns_deg) + drift,
            nearest=nearest * distance,
            farthest=farthest * distance * float(path.reach.max()),
        )

    @property
    def end(self) -> float:
        """When the walk ends [s]."""
        return float(self.times[-1])

    def pose(self, moment: float) -> np.ndarray:
        """Return ``world_from_cam``, shape (4, 4), at a time [s]; before and after the walk it rests."""
        eye, offset, turn = self._curve(min(max(moment, 0.0), self.end)).reshape(3, 3)
        aimed = look_at(eye, np.zeros(3), UP)
        return aimed @ rigid(matrix_from_rotation_vector(turn), offset)

    def motion(self, moment: float, span: float = MOTION_SPAN) -> tuple[np.ndarray, np.ndarray]:
        """Return the camera's velocity [m/s] and angular velocity [rad/s] at a time [s].

        Both have shape (3,), are in the camera's own axes, and are means over ``span`` seconds around the
        moment (less at the ends of the walk).
        """
        from scipy.spatial.transform import Rotation

        before, after = max(moment - 0.5 * span, 0.0), min(moment + 0.5 * span, self.end)
        start_from_end = invert_rigid(self.pose(before)) @ self.pose(after)
        turn = Rotation.from_matrix(start_from_end[:3, :3]).as_rotvec()
        return start_from_end[:3, 3] / (after - before), turn / (after - before)

    @cached_property
    def _curve(self) -> "CubicSpline":
        """Eye, offset and turn as a curve whose acceleration has no jumps."""
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.times, np.hstack([self.eyes, self.offsets, self.turns]))


def _usual_duration(path: Path, distance: float, speed: float) -> float:
    """Return how long the whole path takes [s]."""
    length = distance * float(path.lengths[-1])
    return length / speed if length else HOVERING


def _aim_rms(subject: Subject, eyes: np.ndarray, settings: WalkSettings) -> np.ndarray:
    """Return the RMS of the drift about the camera's axes [rad], as far as the frame has room, (n, 3)."""
    pitch, yaw, roll = np.deg2rad(AIM_RMS_DEG)
    distances = np.linalg.norm(eyes, axis=1)
    free = room(subject.radius, distances, subject.intrinsics, settings.shake, subject.baseline)
    across, up = free.T
    most = AIM_LIMIT * max(settings.unsteadiness, 1e-12)

    def within(rms: float, limit: np.ndarray) -> np.ndarray:
        return rms * limit / np.hypot(limit, most * rms)

    return np.stack([within(pitch, up), within(yaw, across), np.full(len(eyes), roll)], axis=1)


def _lowest_eye(distance: float, subject: Subject, settings: WalkSettings) -> float | None:
    """Return how high above the origin the camera has to stay, before its shake [m]; None: anywhere."""
    if subject.ground is None:
        return None
    shake = PEAK * settings.shake * POSITION_SHAKE.axis_rms
    return subject.ground + CLEARANCE * distance + shake


def _check_above_ground(
    path: Path, distance: float, subject: Subject, settings: WalkSettings
) -> None:
    lowest = _lowest_eye(distance, subject, settings)
    if lowest is None or distance * path.lowest >= lowest:
        return
    words = " ".join(f"{each:g}" for each in settings.chosen_elevations)
    least = np.rad2deg(np.arcsin(min(lowest / distance, 1.0)))
    raise DigsError(
        f"--elevations {words}: the lowest would carry the camera into the ground; from {distance:.3g} m "
        f"away, choose {np.ceil(least):g} degrees or more, or --ground none"
    )


def _kept_above(heights: np.ndarray, lowest: float, softness: float) -> np.ndarray:
    """Return heights above ``lowest``; those well above it hardly change."""
    return lowest + softness * np.logaddexp(0.0, (heights - lowest) / softness)
