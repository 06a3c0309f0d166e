"""The results of many cases on disk: one JSON line for each, added as it ends."""

import json
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.record.fields import parse_json
from digs_warp.record.files import add_line, claim

RESULTS = "results.jsonl"


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
        """Return a record as it is used.

        Raises:
            DigsError: it is none.
        """
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
