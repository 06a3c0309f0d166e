"""The results of a study on disk: one JSON line per case, added as it ends."""

import json
import os
from pathlib import Path
from typing import Any, BinaryIO

from digs_warp.checks import DigsError

RESULTS = "results.jsonl"


class Store:
    """Records of finished cases in ``folder/results.jsonl``, by the key of the case.

    A line is added in one write. A partial last line, left by a killed run, is dropped on reading. The last
    record of a case counts, because a failed case can be run again.
    """

    def __init__(self, folder: Path) -> None:
        self.path = Path(folder) / RESULTS
        self.records: dict[str, dict[str, Any]] = {}
        if self.path.is_file():
            self._read()

    def add(self, record: dict[str, Any]) -> None:
        """Append a record; it has the ``key`` of its case."""
        line = json.dumps(record, allow_nan=False) + "\n"
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with open(self.path, "a+b") as file:
            _drop_half_line(file)
            file.write(line.encode())
            file.flush()
            os.fsync(file.fileno())
        self.records[record["key"]] = record

    def is_done(self, key: str) -> bool:
        """Whether the case succeeded."""
        return "error" not in self.records.get(key, {"error": ""})

    def _read(self) -> None:
        lines = self.path.read_bytes().split(b"\n")
        for number, line in enumerate(lines, start=1):
            if not line.strip():
                continue
            try:
                record = json.loads(line)
                self.records[record["key"]] = record
            except (ValueError, KeyError, TypeError) as error:
                if number == len(lines):  # no newline: the run was killed while it wrote
                    continue
                raise DigsError(
                    f"results '{self.path}', line {number}: not a record ({error!r}); delete the line, "
                    "and its case runs again"
                ) from error


def _drop_half_line(file: BinaryIO) -> None:
    """Cut off what follows the last newline: a killed run left it."""
    file.seek(0)
    content = file.read()
    file.truncate(content.rfind(b"\n") + 1)
