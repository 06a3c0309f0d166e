"""The results of a study on disk, checked on reading."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from digs_warp.engines.task import Results
from digs_warp.record.typed import from_json

Settings = Mapping[str, bool | float | str | None]
Numbers = Mapping[str, float | None]


@dataclass(frozen=True)
class _Finished:
    """What reports count on."""

    labels: Settings
    recording: Settings
    reconstruction: Settings
    seconds: Mapping[str, float]
    recording_seconds: Mapping[str, float]
    machine: str
    metrics: Numbers = field(default_factory=dict)
    yardstick: Numbers = field(default_factory=dict)
    course: tuple[Numbers, ...] = ()


class Store(Results):
    """Records of finished cases in ``folder/results.jsonl``, by the key of the case."""

    def finished(self) -> list[dict[str, Any]]:
        """Return the records of the cases that succeeded.

        Raises:
            DigsError: something is missing in one, or has another type.
        """
        found = [record for record in self.records.values() if "error" not in record]
        for record in found:
            where = f"results '{self.path}', case {record['key']}"
            from_json(_Finished, record, where, remedy="delete its line, and the case runs again")
        return found
