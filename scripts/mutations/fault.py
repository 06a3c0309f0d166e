"""A fault, how it is put into the running program, and faults in what the matching starts from.

No file is edited.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import count
from typing import Any

import numpy as np
import pytest


@dataclass(frozen=True)
class Mutation:
    """A fault.

    Attributes:
        name: in kebab-case.
        what: the fault in words.
        meant: the function of the test that is there to notice it.
        places: "module:attribute" or "module:Class.attribute", what is replaced.
        change: returns the replacement of what is there.
    """

    name: str
    what: str
    meant: str
    places: tuple[str, ...]
    change: Callable[[Any], Any]

    def apply(self, patch: pytest.MonkeyPatch) -> None:
        """Put the fault into the running program.

        Raises:
            AttributeError: there is no such place any more.
        """
        for place in self.places:
            module, _, path = place.partition(":")
            *owners, name = path.split(".")
            owner: Any = import_module(module)
            for step in owners:
                owner = getattr(owner, step)
            old = getattr(owner, name)
            new = self.change(old)
            patch.setattr(owner, name, new)
            if not owners and callable(old):
                _replace_imported(patch, name, old, new)


def _replace_imported(patch: pytest.MonkeyPatch, name: str, old: Any, new: Any) -> None:
    """Replace a function in the modules that have imported it by name."""
    for module in list(sys.modules.values()):
        if getattr(module, "__dict__", {}).get(name) is old:
            patch.setattr(module, name, new)


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


def no_effect(apply: Any) -> Any:
    """Return an effect on depth that changes nothing."""
    return lambda self, sensed, *arguments, **named: sensed


def white_field(octave_normal: Any) -> Any:
    """Return white noise instead of octaves."""

    def mutated(rng: Any, shape: Any, correlation: float) -> Any:
        return rng.standard_normal(shape, dtype=np.float32)

    return mutated


def never_lasting(lasting: Any) -> Any:
    """Return a field that is another one each time."""
    drawn = count()

    def mutated(seed: int, *arguments: Any) -> Any:
        return lasting(seed + 1000 * next(drawn), *arguments)

    return mutated


def value(new: Any) -> Callable[[Any], Any]:
    """Return what replaces a constant."""
    return lambda old: new
