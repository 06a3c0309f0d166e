"""Points -> Gaussians, as 3D Gaussian splatting starts (paper section 3.4; Kerbl et al. 2023, section 4)."""

from dataclasses import replace
from math import log

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.sh import coefficient_count, sh_from_rgb
from digs_warp.init.config import REFERENCE_OPACITY, REFERENCE_WIDTH, InitConfig
from digs_warp.init.start import Subject

NEIGHBORS = 3

# Limits of the scale, relative to the median over all points. Otherwise a stray point far from the surface
# would become a blob that hides the object, and a near-duplicate would be too small for any pixel to see.
MAX_SCALE_RATIO = 5.0
MIN_SCALE_RATIO = 0.1

# A Gaussian at a guessed place starts no more opaque than this: an opaque one hides what other views saw
# behind it. Room of 24 frames (HoloLens), 150 steps: 0.8 gives 20.2 dB and 3.0 cm of depth error on held-out
# frames, without guesses 20.1 dB and 2.9 cm, 0.1 gives 20.4 dB and 2.7 cm.
GUESSED_OPACITY = 0.1

# A Gaussian that no view agrees with still starts visible.
LEAST_OPACITY = 0.1

# The standard deviation [m] if there is no other point, or none at a different position.
LONELY_SCALE = 0.01


def seed_gaussians(
    points: PointCloud,
    sh_degree: int = 0,
    opacity: float = REFERENCE_OPACITY,
    width: float = REFERENCE_WIDTH,
    largest: float = MAX_SCALE_RATIO,
    least: float = LEAST_OPACITY,
) -> Gaussians:
    """Return one Gaussian per point, with the same color from all sides.

    It is round, and its standard deviation is ``width`` times the distance to its neighbors. Its opacity is
    at most the share of views that agree with the point: where their depth contradicts each other, opaque
    Gaussians in front of the surface would hide those on it.

    Args:
        points: any number of points, duplicates allowed.
        sh_degree: degree of the color's spherical harmonics, 0 to 3; all bands above 0 start at zero.
        opacity: of measured points that all views agree with, above 0 and below 1; of guessed ones at most
            `GUESSED_OPACITY`.
        width: standard deviation as a fraction of the distance to the neighbors, above 0.
        largest: the distance counts up to this multiple of the median.
        least: the least opacity of measured points, where no view agrees with one.
    """
    count = len(points)
    apart = neighbor_scales(points.points_world, largest)
    scales = np.repeat(width * apart[:, None], 3, axis=1)
    quats = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    opacities = np.full(count, opacity)
    if points.agreement is not None:
        opacities = np.minimum(opacity, np.maximum(points.agreement, least))
    if points.guessed is not None:
        opacities[points.guessed] = min(opacity, GUESSED_OPACITY)
    return Gaussians(
        means=points.points_world,
        log_scales=np.log(scales),
        quats=quats,
        opacity_logits=np.log(opacities / (1.0 - opacities)),
        sh=_same_from_all_sides(points.colors, sh_degree),
    )


def with_colors(seeds: Gaussians, colors: np.ndarray, sh_degree: int) -> Gaussians:
    """Return seeds in other colors, sRGB, shape (n, 3), and with bands up to another degree."""
    return replace(seeds, sh=_same_from_all_sides(colors, sh_degree))


def _same_from_all_sides(colors: np.ndarray, sh_degree: int) -> np.ndarray:
    sh = np.zeros((len(colors), coefficient_count(sh_degree), 3))
    sh[:, 0] = sh_from_rgb(colors)
    return sh


def neighbor_scales(points_world: np.ndarray, largest: float = MAX_SCALE_RATIO) -> np.ndarray:
    """Return the root mean squared distance [m] to the three nearest neighbors, shape (n,), clamped.

    With fewer than four points, all others are neighbors.
    """
    from scipy.spatial import KDTree

    count = len(points_world)
    neighbors = min(NEIGHBORS, count - 1)
    if neighbors < 1:
        return np.full(count, LONELY_SCALE)
    # The nearest hit of each query is the point itself (or a duplicate, also at distance 0).
    distances, _ = KDTree(points_world).query(points_world, k=neighbors + 1, workers=-1)
    scales = np.sqrt(np.mean(np.square(distances[:, 1:]), axis=1))
    typical = np.median(scales[scales > 0]) if np.any(scales > 0) else LONELY_SCALE
    return np.clip(scales, MIN_SCALE_RATIO * typical, largest * typical)


# Points of a scene start at most this opaque: it has surfaces behind surfaces, and its depth and poses are
# less exact. Figures: docs/research/training-tried.md.
SCENE_OPACITY = 0.5

# In a scene, voxels grow with the distance, and the points of the far shell lie metres apart.
SCENE_SCALE_RATIO = 100.0

# Where views disagree, an opaque Gaussian in front of the surface hides those on it to the end of a run of
# the first length. In one of the second it is gone anyway, and what starts opaque ends nearer to the truth.
SHORT_STEPS, LONG_STEPS = 300, 1000


def seed_start(
    config: InitConfig, subject: Subject, steps: int
) -> tuple[float, float, float, float]:
    """Return the arguments of `seed_gaussians` after points and degree.

    Args:
        config: the strategy.
        subject: what is reconstructed.
        steps: of the whole run; 0: the Gaussians stay as they start.
    """
    opacity, width = config.defaults.opacity, config.defaults.width
    if subject == "scene":
        return min(opacity, SCENE_OPACITY), width, SCENE_SCALE_RATIO, LEAST_OPACITY
    return opacity, width, MAX_SCALE_RATIO, _least_opacity(opacity, steps)


def _least_opacity(opacity: float, steps: int) -> float:
    """Return the opacity of points that no view agrees with; in between, by the logarithm of the steps."""
    if opacity <= LEAST_OPACITY:
        return opacity
    shortness = log(LONG_STEPS / max(steps, 1)) / log(LONG_STEPS / SHORT_STEPS)
    share = min(max(shortness, 0.0), 1.0)
    return opacity * (LEAST_OPACITY / opacity) ** share
