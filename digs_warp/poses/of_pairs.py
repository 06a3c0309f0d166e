"""What pairs of frames say: the motion between two, and a measure of each pair."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from digs_warp.device.threads import over_items
from digs_warp.geometry.rigid import invert_rigid

_F = TypeVar("_F")


def motions_of(poses: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return ``target_from_source`` of each pair, (k, 4, 4).

    Args:
        poses: ``world_from_cam``, (n, 4, 4).
        pairs: numbers of source and target, (k, 2).
    """
    return np.stack([invert_rigid(poses[j]) @ poses[i] for i, j in pairs])


def measured_pairs(
    measure: Callable[[_F, _F, np.ndarray], float],
    frames: Sequence[_F],
    poses: np.ndarray,
    pairs: np.ndarray,
) -> np.ndarray:
    """Return ``measure(source, target, target_from_source)`` of each pair, (k,), computed on all cores.

    Args:
        measure: what is asked of two frames and the motion between them.
        frames: n, in the form that ``measure`` takes.
        poses: ``world_from_cam``, (n, 4, 4).
        pairs: numbers of source and target, (k, 2).
    """

    def measured(pair: np.ndarray) -> float:
        i, j = pair
        return measure(frames[i], frames[j], invert_rigid(poses[j]) @ poses[i])

    return np.array(over_items(list(pairs), measured))


def medians_of_frames(pairs: np.ndarray, count: int, values: np.ndarray) -> np.ndarray:
    """Return the median of the values (k,) of each frame's pairs, (count,); NaN for what has no pair."""
    found = np.full(count, np.nan)
    for number in np.unique(pairs):
        found[number] = np.median(values[(pairs == number).any(axis=1)])
    return found
