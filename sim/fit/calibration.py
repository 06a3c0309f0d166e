"""Drift of the stereo calibration (angles and focal length of the right eye, baseline), and depth bias.

Errors that depend on place and disparity as `digs_warp.sim.sensor.drift` says, by least squares. The angle
about the x axis moves rows alone, so that disparity does not tell it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.geometry.camera import Intrinsics
from digs_warp.sim.fit.depth_noise import Moments, residuals
from digs_warp.sim.fit.estimate import BLOCKS, UNKNOWN, Estimate, block_numbers
from digs_warp.sim.fit.wall import Pose, Wall
from digs_warp.sim.sensor.drift import NO_DRIFT, Drift

# A line through fewer points has no scatter to tell its error from.
FEWEST_POSES = 3

# Distances differ enough for a scale if their disparities do by this factor.
LEVER = 1.3


def bias(wall: Wall, distances: Sequence[float] | None = None) -> tuple[Estimate, Estimate]:
    """Return offset [px] and scale of the disparity: measured = scale * true + offset.

    A straight line through the poses; its error follows from how far they lie off it.

    Args:
        wall: with true disparity, or with ``distances``.
        distances: depth of the wall on the optical axis at each pose, from the nearest to the farthest [m].
    """
    pairs = [_pair(wall, pose, distance) for pose, distance in _known(wall, distances)]
    if len(pairs) < FEWEST_POSES:
        return UNKNOWN, UNKNOWN
    true, measured = np.array(pairs).T
    if true.max() < LEVER * true.min():
        return UNKNOWN, UNKNOWN
    return fit_line(true, measured)


def fit_line(x: np.ndarray, y: np.ndarray) -> tuple[Estimate, Estimate]:
    """Return offset and slope of y = slope * x + offset by least squares; three points or more."""
    from scipy.stats import t

    center = x.mean()
    spread = np.sum((x - center) ** 2)
    slope = float(np.sum((x - center) * y) / spread)
    offset = float(y.mean() - slope * center)
    freedom = len(x) - 2
    scatter = np.sqrt(np.sum((y - slope * x - offset) ** 2) / freedom)
    # Few points underestimate their scatter now and then: as wide as the 95 % interval would be.
    scatter *= t.ppf(0.975, freedom) / 1.96
    return (
        Estimate(offset, float(scatter * np.sqrt(1 / len(x) + center**2 / spread))),
        Estimate(slope, float(scatter / np.sqrt(spread))),
    )


def _known(wall: Wall, distances: Sequence[float] | None) -> list[tuple[Pose, float | None]]:
    if distances is not None:
        return list(zip(wall.poses, distances, strict=True))
    return [(pose, None) for pose in wall.poses if pose.true is not None]


def _pair(wall: Wall, pose: Pose, distance: float | None) -> tuple[float, float]:
    """Return true and measured disparity of a pose [px]."""
    if distance is not None:
        return wall.focal_baseline / distance, wall.focal_baseline / wall.distance(pose)
    assert pose.true is not None
    measured = Moments(residuals(pose)).mean + pose.plane.disparity(wall.shape)
    known = np.isfinite(measured) & np.isfinite(pose.true)
    return float(pose.true[known].mean()), float(measured[known].mean())


# Changes for which the errors are computed: angles [degree] and shares; errors are proportional to them.
STEPS = {"yaw_deg": 0.01, "roll_deg": 0.01, "focal": 1e-4, "baseline": 1e-4}

# The error of a half-known image is not worth a line through it.
FEWEST = 1000


@dataclass(frozen=True)
class Calibration:
    """The drift of a unit, as far as its depth tells; see `Drift`.

    Attributes:
        yaw_deg, roll_deg: angles of the right eye.
        focal, baseline: relative changes.
    """

    yaw_deg: Estimate = UNKNOWN
    roll_deg: Estimate = UNKNOWN
    focal: Estimate = UNKNOWN
    baseline: Estimate = UNKNOWN

    @property
    def drift(self) -> Drift:
        """The drift with these values; nothing where a value is not known."""
        known = {name: getattr(self, name) for name in STEPS if getattr(self, name).is_known}
        return replace(NO_DRIFT, **{name: estimate.value for name, estimate in known.items()})

    @property
    def figures(self) -> dict[str, Estimate]:
        """Figures of the rig: from one unit, the size of its drift is taken for the spread of all."""
        angles = [angle for angle in (self.yaw_deg, self.roll_deg) if angle.is_known]
        found = {
            "rotation_drift": _size(angles),
            "focal_drift": _size([self.focal]),
            "baseline_drift": _size([self.baseline]),
        }
        return {name: estimate for name, estimate in found.items() if estimate.is_known}


def calibrate_wall(wall: Wall, distances: Sequence[float] | None = None) -> Calibration:
    """Return the drift of the camera that recorded a wall.

    Args:
        wall: with true disparity, which tells all of it.
        distances: instead of it, depth of the wall on the optical axis at each pose [m]; they tell the angle
            about the y axis, and a scale, which is taken for the baseline's.
    """
    if distances is not None:
        offset, scale = bias(wall, distances)
        per_px = -float(np.rad2deg(1 / wall.intrinsics.fx))
        return Calibration(
            yaw_deg=Estimate(offset.value * per_px, abs(offset.error * per_px)),
            baseline=Estimate(scale.value - 1, scale.error),
        )
    known = [(pose, pose.true) for pose in wall.poses if pose.true is not None]
    errors = [_measured(wall, pose) - true for pose, true in known]
    return calibrate(errors, [true for _, true in known], wall.intrinsics)


def _measured(wall: Wall, pose: Pose) -> np.ndarray:
    return Moments(residuals(pose)).mean + pose.plane.disparity(wall.shape)


def calibrate(
    errors: Sequence[np.ndarray], true: Sequence[np.ndarray], k: Intrinsics
) -> Calibration:
    """Return the drift that explains error images best.

    Its error adds up what changes without one block of the image, and without one of the images: the static
    field does not change between images, the error of matching a texture does not change within one.

    Args:
        errors: measured minus true disparity [px], each (height, width), NaN where unknown.
        true: disparity of each [px].
        k: of the calibration.
    """
    count = len(STEPS)
    products = np.zeros((len(errors), BLOCKS, count, count + 1))
    for number, (error, disparity) in enumerate(zip(errors, true, strict=True)):
        products[number] = _products(error, np.asarray(disparity, np.float64), k)
    by_block, by_image = products.sum(axis=0), products.sum(axis=1)
    total = by_block.sum(axis=0)
    if sum(np.isfinite(error).sum() for error in errors) < FEWEST:
        return Calibration()
    variance = _jackknife_variance(by_block) + _jackknife_variance(by_image)
    values, scale = _solve(total), np.array(list(STEPS.values()))
    estimates = [
        Estimate(float(v), float(e))
        for v, e in zip(values * scale, np.sqrt(variance) * scale, strict=True)
    ]
    return Calibration(**dict(zip(STEPS, estimates, strict=True)))


def _products(error: np.ndarray, disparity: np.ndarray, k: Intrinsics) -> np.ndarray:
    """Return the sums of each block for least squares, (BLOCKS, n, n + 1): matrix, and right side."""
    known = np.isfinite(error) & np.isfinite(disparity)
    blocks = block_numbers(error.shape)[known]
    terms = []
    for name, step in STEPS.items():
        drift = replace(NO_DRIFT, **{name: step})
        changed = drift.reported_disparity(drift.shown_disparity(disparity, k).astype(np.float64))
        terms.append((changed - disparity)[known])
    columns = [*terms, error[known]]
    sums = [[np.bincount(blocks, a * b, BLOCKS) for b in columns] for a in terms]
    return np.moveaxis(np.array(sums), 2, 0)


def _solve(sums: np.ndarray) -> np.ndarray:
    return np.linalg.lstsq(sums[:, :-1], sums[:, -1], rcond=1e-12)[0]


def _jackknife_variance(parts: np.ndarray) -> np.ndarray:
    """Return the variance of the solution by leaving out one part after another; one part tells nothing."""
    parts = parts[np.any(parts != 0, axis=(1, 2))]
    count = len(parts)
    if count < 2:
        return np.zeros(parts.shape[1])
    others = np.array([_solve(parts.sum(axis=0) - own) for own in parts])
    return (count - 1) / count * np.sum((others - others.mean(axis=0)) ** 2, axis=0)


def _size(parts: Sequence[Estimate]) -> Estimate:
    """Return the root of the mean square of values whose errors are no part of it."""
    parts = [part for part in parts if part.is_known]
    if not parts:
        return UNKNOWN
    square = np.mean([part.value**2 - part.error**2 for part in parts])
    variance = [4 * part.value**2 * part.error**2 + 2 * part.error**4 for part in parts]
    return Estimate(float(square), float(np.sqrt(np.sum(variance))) / len(parts)).root()
