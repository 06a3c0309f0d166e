"""Faults in what the matching starts from: images, calibration, candidates, dots."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np


def stronger(factor: float) -> Callable[[Any], Any]:
    """Return what turns an effect on the images into a stronger one."""

    def mutate(apply: Any) -> Any:
        def mutated(self: Any, eyes: Any, rig: Any, rng: Any, strength: float = 1.0) -> Any:
            return apply(self, eyes, rig, rng, factor * strength)

        return mutated

    return mutate


def same_in_both_eyes(apply: Any) -> Any:
    """Return an effect whose change of the left image is made to both."""

    def mutated(self: Any, eyes: Any, *arguments: Any, **named: Any) -> Any:
        changed = apply(self, eyes, *arguments, **named)
        return replace(changed, right=eyes.right + (changed.left - eyes.left))

    return mutated


def blind_to_noise(matching: Any) -> Any:
    """Return matching of the rendered instead of the recorded images."""

    def mutated(truth: Any, recorded: Any = None, *arguments: Any, **named: Any) -> Any:
        return matching(truth, None, *arguments, **named)

    return mutated


def with_default(**defaults: Any) -> Callable[[Any], Any]:
    """Return what gives a function other values for arguments that callers leave out."""

    def mutate(function: Any) -> Any:
        def mutated(*arguments: Any, **named: Any) -> Any:
            return function(*arguments, **(defaults | named))

        return mutated

    return mutate


def nothing_far(coarse_half_blocks: Any) -> Any:
    """Return a coarse search that never prefers anything."""

    def mutated(*arguments: Any, **named: Any) -> Any:
        return np.full_like(coarse_half_blocks(*arguments, **named), -1)

    return mutated


def drifting_farther(draw: Any) -> Any:
    """Return a draw of a stronger drift."""

    def mutated(self: Any, rig: Any, seed: int, strength: float = 1.0) -> Any:
        return draw(self, rig, seed, 1.3 * strength)

    return mutated


def brighter_dots(dot_pattern: Any) -> Any:
    """Return a projector with dots 1.3 times as bright."""

    def mutated() -> Any:
        pattern = dot_pattern()
        return replace(pattern, dots=pattern.dots * np.array([1, 1, 1.3], np.float32))

    return mutated


def baseline_flipped(reported_disparity: Any) -> Any:
    """Return a camera whose depth grows with the baseline."""
    return lambda self, matched: matched / np.float32(1 + self.baseline)


def value(new: Any) -> Callable[[Any], Any]:
    """Return what replaces a constant."""
    return lambda old: new
