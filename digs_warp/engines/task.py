"""One call with a result that is kept, and how a worker makes it."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from digs_warp.engines.needs import ONE_THREAD, Needs
from digs_warp.record.files import read_json, to_json, write_atomically
from digs_warp.record.lock import taking_turns

# Folder of the results that no line has been written for yet, one file for each.
FINISHED = "finished"


@dataclass(frozen=True)
class Task:
    """One case of many.

    Attributes:
        key: identifies the case across runs; it can be the name of a file.
        name: of the case, in messages.
        function: at module level; returns a mapping that can be written as JSON.
        arguments: of the function, which can be pickled.
        needs: what it may use.
        effort: estimated time relative to the other cases, for a time budget.
        facts: what the line of the case says beside its result.
    """

    key: str
    name: str
    function: Callable[..., Mapping[str, Any]]
    arguments: tuple[Any, ...]
    needs: Needs = ONE_THREAD
    effort: float = 1.0
    facts: Mapping[str, Any] = field(default_factory=dict)


def finished_file(folder: Path, key: str) -> Path:
    """Return where a worker leaves the result of a case."""
    return folder / FINISHED / f"{key}.json"


def perform(
    place: Path, function: Callable[..., Mapping[str, Any]], arguments: tuple[Any, ...]
) -> dict[str, Any]:
    """Call a function and leave its result at ``place``, with ``case_seconds``; what a worker does.

    A result that is there already is taken: the call of an earlier run may have ended after that run. Two
    calls for one result wait for each other.
    """
    with taking_turns(place):
        if not place.is_file():
            start = time.monotonic()
            result = dict(function(*arguments))
            result["case_seconds"] = round(time.monotonic() - start, 3)
            write_atomically(place, to_json(result).encode())
        return read_json(place, "result")
