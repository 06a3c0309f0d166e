"""The results of a study on disk, checked on reading."""

from typing import Any

from digs_warp.checks import DigsError
from digs_warp.engines.task import Results
from digs_warp.measure.scores import named_now
from digs_warp.record.fields import Fields


class Store(Results):
    """Records of finished cases in ``folder/results.jsonl``, by the key of the case."""

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

    def checked(self, content: Any) -> dict[str, Any]:
        """Return a record whose parts have the types that the reports count on, its metrics named as today.

        Raises:
            DigsError: one has another type.
        """
        return _checked(content)


# Sections of a record: settings, seconds, and other numbers; and what a case that succeeded has.
_SETTINGS = ("labels", "recording", "reconstruction")
_SECONDS = ("seconds", "recording_seconds")
_NUMBERS = ("metrics", "yardstick")
_FINISHED = (*_SETTINGS, *_SECONDS, "machine")


def _checked(content: Any) -> dict[str, Any]:
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
