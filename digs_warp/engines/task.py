"""One case of many: how a worker makes it, and where its result is kept."""

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.engines.engine import ONE_THREAD, Needs
from digs_warp.record.fields import parse_json
from digs_warp.record.files import add_line, claim, read_json, to_json, write_atomically
from digs_warp.record.lock import taking_turns

RESULTS = "results.jsonl"


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
        facts: what the line of the case says beside its result.
    """

    key: str
    name: str
    function: Callable[..., Mapping[str, Any]]
    arguments: tuple[Any, ...]
    needs: Needs = ONE_THREAD
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


class Results:
    """Records of cases in ``folder/results.jsonl``, by the key of the case; those that failed have ``error``.

    A partial last line, left by a killed run, is dropped on reading. The last record of a case counts:
    a failed case can be run again.
    """

    def __init__(self, folder: Path) -> None:
        self.path = Path(folder) / RESULTS
        self.records: dict[str, dict[str, Any]] = {}
        if self.path.is_file():
            self._read()

    def add(self, record: dict[str, Any]) -> None:
        """Append a record; it has the ``key`` of its case."""
        claim(self.path)
        add_line(self.path, json.dumps(record, allow_nan=False))
        self.records[record["key"]] = record

    def is_done(self, key: str) -> bool:
        """Whether the case succeeded."""
        return "error" not in self.records.get(key, {"error": ""})

    def forget(self, key: str) -> None:
        """Take a case for one that has not run; its next line counts."""
        self.records.pop(key, None)

    def checked(self, content: Any) -> dict[str, Any]:
        """Return a record as it is used."""
        if not isinstance(content, dict) or not isinstance(content.get("key"), str):
            raise DigsError("record: expected a JSON object with a key")
        return content

    def _read(self) -> None:
        lines = self.path.read_bytes().split(b"\n")
        for number, line in enumerate(lines, start=1):
            if not line.strip():
                continue
            try:
                record = self.checked(parse_json(line))
                self.records[record["key"]] = record
            except ValueError as error:
                if number == len(lines):  # no newline: the run was killed while it wrote
                    continue
                raise DigsError(
                    f"results '{self.path}', line {number}: not a record ({error}); delete the line, "
                    "and its case runs again"
                ) from error
