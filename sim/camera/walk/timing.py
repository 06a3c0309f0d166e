"""When the frames of a recording are taken."""

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.sim.camera.walk.settings import WalkSettings

# Identifies jitter and dropped frames in the seeds.
JITTER, DROPPED = 106, 107

# Moments stray by up to this many standard deviations, and by less than half the time between frames.
MOST_DEVIATIONS = 3.0


def kept_count(beats: int, settings: WalkSettings) -> int:
    """Return how many of the frames are not lost; at least one is kept."""
    return max(1, beats - round(settings.dropped_frames * beats))


def frame_moments(beats: int, settings: WalkSettings, end: float, seed: int) -> tuple[float, ...]:
    """Return the times [s] of the frames of a walk, ascending; the first is taken at 0.

    Args:
        beats: number of frames, with those that are lost, >= 1.
        settings: of the walk.
        end: of the walk [s].
        seed: of jitter and losses.

    Raises:
        DigsError: a jitter that is too large for the time between frames.
    """
    period = 1.0 / settings.fps if settings.fps is not None else end / beats
    moments = period * np.arange(beats)
    if settings.time_jitter > 0:
        largest = period / (2 * MOST_DEVIATIONS)
        if settings.time_jitter >= largest:
            raise DigsError(
                f"time_jitter {settings.time_jitter:g}: frames are {period:.3g} s apart and would change "
                f"places; expected less than {largest:.3g}"
            )
        rng = np.random.default_rng([seed, JITTER])
        strayed = np.clip(rng.standard_normal(beats), -MOST_DEVIATIONS, MOST_DEVIATIONS)
        moments[1:] += settings.time_jitter * strayed[1:]
    lost = beats - kept_count(beats, settings)
    rng = np.random.default_rng([seed, DROPPED])
    dropped = 1 + rng.choice(max(beats - 1, 1), lost, replace=False)
    return tuple(np.delete(moments, dropped).tolist())
