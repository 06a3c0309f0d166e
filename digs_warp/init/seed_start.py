"""How opaque and wide the first Gaussians are: by the strategy, the subject, and the length of the run."""

from math import log
from typing import NamedTuple

from digs_warp.init.config import InitConfig
from digs_warp.init.seed_gaussians import LEAST_OPACITY, MAX_SCALE_RATIO
from digs_warp.init.start import Subject

# Points of a scene start at most this opaque: it has surfaces behind surfaces, and its depth and poses are
# less exact. Figures: docs/training-tried.md.
SCENE_OPACITY = 0.5

# In a scene, voxels grow with the distance, and the points of the far shell lie metres apart.
SCENE_SCALE_RATIO = 100.0

# Where views disagree, an opaque Gaussian in front of the surface hides those on it to the end of a run of
# the first length. In one of the second it is gone anyway, and what starts opaque ends nearer to the truth.
SHORT_STEPS, LONG_STEPS = 300, 1000


class SeedStart(NamedTuple):
    """The arguments of `seed_gaussians` after points and degree; its docstring says what they are."""

    opacity: float
    width: float
    largest: float
    least: float


def seed_start(config: InitConfig, subject: Subject, steps: int) -> SeedStart:
    """Return how the Gaussians start.

    Args:
        config: strategy, opacity and width.
        subject: what is reconstructed.
        steps: of the whole run; 0: the Gaussians stay as they start.
    """
    opacity, width = config.seed_opacity, config.seed_width
    if subject == "scene":
        if config.opacity is None:
            opacity = min(opacity, SCENE_OPACITY)
        return SeedStart(opacity, width, SCENE_SCALE_RATIO, LEAST_OPACITY)
    return SeedStart(opacity, width, MAX_SCALE_RATIO, _least_opacity(opacity, steps))


def _least_opacity(opacity: float, steps: int) -> float:
    """Return the opacity of points that no view agrees with; in between, by the logarithm of the steps."""
    if opacity <= LEAST_OPACITY:
        return opacity
    shortness = log(LONG_STEPS / max(steps, 1)) / log(LONG_STEPS / SHORT_STEPS)
    share = min(max(shortness, 0.0), 1.0)
    return opacity * (LEAST_OPACITY / opacity) ** share
