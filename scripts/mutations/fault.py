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


def around(change: Callable[..., Any]) -> Callable[[Any], Any]:
    """Return what replaces a function by ``change``, which gets the function and its arguments."""
    return lambda old: lambda *given, **named: change(old, *given, **named)


def value(new: Any) -> Callable[[Any], Any]:
    """Return what replaces a constant."""
    return lambda old: new


def stronger(factor: float) -> Callable[[Any], Any]:
    """Return what turns an effect on the images into a stronger one."""

    def change(apply: Any, self: Any, eyes: Any, rig: Any, rng: Any, strength: float = 1.0) -> Any:
        return apply(self, eyes, rig, rng, factor * strength)

    return around(change)


@around
def same_in_both_eyes(apply: Any, self: Any, eyes: Any, *given: Any, **named: Any) -> Any:
    """The change of the left image is made to both."""
    changed = apply(self, eyes, *given, **named)
    return replace(changed, right=eyes.right + (changed.left - eyes.left))


@around
def blind_to_noise(
    matching: Any, truth: Any, recorded: Any = None, *given: Any, **named: Any
) -> Any:
    """The rendered instead of the recorded images are matched."""
    return matching(truth, None, *given, **named)


def with_default(**defaults: Any) -> Callable[[Any], Any]:
    """Return what gives a function other values for arguments that callers leave out."""
    return around(lambda function, *given, **named: function(*given, **(defaults | named)))


@around
def nothing_far(coarse_half_blocks: Any, *given: Any, **named: Any) -> Any:
    """The coarse search never prefers anything."""
    return np.full_like(coarse_half_blocks(*given, **named), -1)


@around
def drifting_farther(draw: Any, self: Any, rig: Any, seed: int, strength: float = 1.0) -> Any:
    """A stronger drift is drawn."""
    return draw(self, rig, seed, 1.3 * strength)


@around
def brighter_dots(dot_pattern: Any) -> Any:
    """The dots of the projector are 1.3 times as bright."""
    pattern = dot_pattern()
    return replace(pattern, dots=pattern.dots * np.array([1, 1, 1.3], np.float32))


@around
def baseline_flipped(reported_disparity: Any, self: Any, matched: Any) -> Any:
    """Depth grows with the baseline."""
    return matched / np.float32(1 + self.baseline)


@around
def no_effect(apply: Any, self: Any, sensed: Any, *given: Any, **named: Any) -> Any:
    """An effect on depth changes nothing."""
    return sensed


@around
def white_field(octave_normal: Any, rng: Any, shape: Any, correlation: float) -> Any:
    """White noise instead of octaves."""
    return rng.standard_normal(shape, dtype=np.float32)


def never_lasting(lasting: Any) -> Any:
    """Return a field that is another one each time."""
    drawn = count()
    return lambda seed, *given: lasting(seed + 1000 * next(drawn), *given)
