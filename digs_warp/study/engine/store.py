"""The results of a study on disk: one JSON line per case, added as it ends."""

import json
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.measure.scores import named_now
from digs_warp.record.fields import Fields, parse_json
from digs_warp.record.files import add_line

RESULTS = "results.jsonl"


class Store:
    """Records of finished cases in ``folder/results.jsonl``, by the key of the case.

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
        add_line(self.path, json.dumps(record, allow_nan=False))
        self.records[record["key"]] = record

    def is_done(self, key: str) -> bool:
        """Whether the case succeeded."""
        return "error" not in self.records.get(key, {"error": ""})

    def finished(self) -> list[dict[str, Any]]:
        """Return the records of the cases that succeeded.

        Raises:
            DigsError: one is not complete.
        """
        found = [record for record in self.records.values() if "error" not in record]
        for record in found:
            if lacking := [name for name in _FINISHED if record.get(name) is None]:
                raise DigsError(
                    f"results '{self.path}', case {record['key']}: has no '{lacking[0]}'; delete its line, "
                    "and the case runs again"
                )
        return found

    def _read(self) -> None:
        lines = self.path.read_bytes().split(b"\n")
        for number, line in enumerate(lines, start=1):
            if not line.strip():
                continue
            try:
                record = _checked(parse_json(line))
                self.records[record["key"]] = record
            except ValueError as error:
                if number == len(lines):  # no newline: the run was killed while it wrote
                    continue
                raise DigsError(
                    f"results '{self.path}', line {number}: not a record ({error}); delete the line, "
                    "and its case runs again"
                ) from error


# Sections of a record: settings, seconds, and other numbers; and what a case that succeeded has.
_SETTINGS = ("labels", "recording", "reconstruction")
_SECONDS = ("seconds", "recording_seconds")
_NUMBERS = ("metrics", "yardstick")
_FINISHED = (*_SETTINGS, *_SECONDS, "machine")


def _checked(content: Any) -> dict[str, Any]:
    """Return a record whose parts have the types that the reports count on, its metrics named as today.

    Raises:
        DigsError: one has another type.
    """
    record = Fields.of(content, "record")
    record.text("key")
    record.text("machine", "")
    for name in _SETTINGS:
        settings = record.section(name, optional=True).values
        if broken := [key for key, value in settings.items() if isinstance(value, list | dict)]:
            raise DigsError(
                f"record: {name}, {broken[0]}: expected a number, a text, true or false"
            )
    for seconds in (record.section(name, optional=True) for name in _SECONDS):
        for name in seconds.values:
            seconds.number(name, 0, what="seconds")
    others = [record.section(name, optional=True) for name in _NUMBERS]
    for section in [*others, *record.sections("course", [])]:
        for name in section.values:
            section.number(name, default=None)
    found = dict(record.values)
    for name in _NUMBERS:
        if name in record:
            found[name] = named_now(found[name])
    if "course" in record:
        found["course"] = [named_now(row) for row in found["course"]]
    return found
