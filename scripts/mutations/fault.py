"""A fault, and how it is put into the running program; no file is edited."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

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
