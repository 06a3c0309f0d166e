"""Faults in the errors of the default sensor: each changes what it found before anything else sees it.

All keep as much as they can of the rest: the number of failures, the size of the errors, the squares of
`BLOCK` pixels in which they lie. Random choices depend on the image alone.
"""

import zlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from digs_warp.sim.sensor.error_attribution import WRONG, attribute_errors
from digs_warp.sim.sensor.frame import MATCHABLE_SNR, FrameTruth, Sensed
from mutations.fault import around

BLOCK = 20  # [px], as in `studies.realism_scores`

# Takes disparity, the true one, and random numbers; returns disparity.
Change = Callable[[np.ndarray, FrameTruth, np.random.Generator], np.ndarray]


def disparity(change: Change) -> Callable[[Any], Any]:
    """Return what turns the matching of a frame into one whose disparity is changed."""

    def changed(matching: Any, truth: FrameTruth, *given: Any, **named: Any) -> Sensed:
        sensed = matching(truth, *given, **named)
        found = change(sensed.disparity.copy(), truth, _generator(sensed))
        found = (np.rint(16 * found) / 16).astype(np.float32)
        confidence = np.where(sensed.known, sensed.confidence, np.float32(0.9))
        confidence[np.isnan(found)] = 0
        cause = attribute_errors(found, truth)
        return replace(sensed, disparity=found, confidence=confidence, cause=cause)

    return around(changed)


def confidence(change: Callable[[Sensed, FrameTruth], np.ndarray]) -> Callable[[Any], Any]:
    """Return what turns the matching of a frame into one whose confidence is changed."""

    def changed(matching: Any, truth: FrameTruth, *given: Any, **named: Any) -> Sensed:
        sensed = matching(truth, *given, **named)
        found = np.where(sensed.known, change(sensed, truth), 0)
        return replace(sensed, confidence=found.astype(np.float32))

    return around(changed)


def _generator(sensed: Sensed) -> np.random.Generator:
    return np.random.default_rng(zlib.crc32(np.nan_to_num(sensed.disparity).tobytes()))


def _small(found: np.ndarray, truth: FrameTruth) -> np.ndarray:
    return np.abs(found - truth.disparity) <= WRONG


def _failed(found: np.ndarray, truth: FrameTruth) -> np.ndarray:
    return np.isfinite(truth.disparity) & ~_small(found, truth)


def _squares(shape: tuple[int, ...]) -> list[tuple[slice, slice]]:
    rows, columns = (range(0, size, BLOCK) for size in shape)
    return [(slice(y, y + BLOCK), slice(x, x + BLOCK)) for y in rows for x in columns]


def shuffled_in_squares(
    found: np.ndarray, truth: FrameTruth, rng: np.random.Generator
) -> np.ndarray:
    """Small errors change places within their square."""
    small = _small(found, truth)
    error = found - truth.disparity
    for square in _squares(found.shape):
        error[square][small[square]] = rng.permutation(error[square][small[square]])
    return truth.disparity + error


def white(found: np.ndarray, truth: FrameTruth, rng: np.random.Generator) -> np.ndarray:
    """Small errors are replaced by white noise of the same deviation in their square."""
    small = _small(found, truth)
    error = found - truth.disparity
    for square in _squares(found.shape):
        values = error[square][small[square]]
        if len(values):
            sigma = np.sqrt(np.mean(values**2))
            noise = sigma * rng.standard_normal(len(values))
            error[square][small[square]] = np.clip(noise, -WRONG, WRONG)
    return truth.disparity + error


def right_in_weak_texture(
    found: np.ndarray, truth: FrameTruth, rng: np.random.Generator
) -> np.ndarray:
    """Where there is less texture than noise, the truth is found."""
    return np.where(truth.texture_snr < MATCHABLE_SNR, truth.disparity, found)


def strips_doubled(found: np.ndarray, truth: FrameTruth, rng: np.random.Generator) -> np.ndarray:
    """Every run of failures along a row goes on to the right for its own length, with its own errors."""
    failed = _failed(found, truth)
    error = found - truth.disparity
    ends = np.diff(np.pad(failed, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, starts = np.nonzero(ends == 1)
    stops = np.nonzero(ends == -1)[1]
    doubled = error.copy()
    for row, start, stop in zip(rows, starts, stops, strict=True):
        target = doubled[row, stop : 2 * stop - start]
        target[:] = error[row, start:stop][: len(target)]
    doubled[failed] = error[failed]
    return truth.disparity + doubled


def new_in_every_frame(
    found: np.ndarray, truth: FrameTruth, rng: np.random.Generator
) -> np.ndarray:
    """The errors of each square move round within it, each time by another distance."""
    error = found - truth.disparity
    for square in _squares(found.shape):
        shift = tuple(rng.integers(0, BLOCK, 2))
        error[square] = np.roll(error[square], shift, (0, 1))
    return truth.disparity + error


def salt(found: np.ndarray, truth: FrameTruth, rng: np.random.Generator) -> np.ndarray:
    """Holes become single pixels at random places of their square; there are as many."""
    holes = np.isnan(found)
    found[holes] = truth.disparity[holes]
    for square in _squares(found.shape):
        count = np.count_nonzero(holes[square])
        chosen = rng.permutation(found[square].size)[:count]
        values = found[square].ravel()
        values[chosen] = np.nan
        found[square] = values.reshape(found[square].shape)
    return found


def scaled(factor: float) -> Change:
    """Small errors are larger or smaller by a factor; negative: they have the wrong sign."""

    def change(found: np.ndarray, truth: FrameTruth, rng: np.random.Generator) -> np.ndarray:
        error = np.clip(factor * (found - truth.disparity), -WRONG, WRONG)
        return np.where(_small(found, truth), truth.disparity + error, found)

    return change


def fewer_wrong(found: np.ndarray, truth: FrameTruth, rng: np.random.Generator) -> np.ndarray:
    """Every fourth row's wrong matches are found after all."""
    wrong = np.isfinite(found) & _failed(found, truth)
    wrong[np.arange(len(wrong)) % 4 > 0] = False
    return np.where(wrong, truth.disparity, found)


def wrong_side(found: np.ndarray, truth: FrameTruth, rng: np.random.Generator) -> np.ndarray:
    """What the right eye cannot see is found; as much on the other side of the near surface is missing."""
    true = truth.disparity
    found = np.where(truth.hidden, true, found)
    drop = np.nan_to_num(true[:, :-1] - true[:, 1:])
    for row, column in np.argwhere(drop > 2):
        found[row, column + 1 : column + 1 + int(np.rint(drop[row, column]))] = np.nan
    return found


def eighths(found: np.ndarray, truth: FrameTruth, rng: np.random.Generator) -> np.ndarray:
    """Disparity comes in eighths of a pixel."""
    return np.rint(8 * found) / 8


def label(sensed: Sensed, truth: FrameTruth) -> np.ndarray:
    """Confidence says whether the match is right."""
    return np.where(_small(sensed.disparity, truth), 1.0, 0.5)


def nearness(sensed: Sensed, truth: FrameTruth) -> np.ndarray:
    """Confidence tells how near the match is to the truth, in every shade."""
    return np.exp(-np.square(sensed.disparity - truth.disparity)) * sensed.confidence**0.2


def boasting(sensed: Sensed, truth: FrameTruth) -> np.ndarray:
    """The odds of being wrong are stated a third too low."""
    return sensed.confidence / (sensed.confidence + (1 - sensed.confidence) / 1.5)
