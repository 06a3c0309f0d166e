"""What the record of a simulated capture says about its object."""

from dataclasses import dataclass
from pathlib import Path

from digs_warp.record.run_log import RunRecord


@dataclass(frozen=True)
class RecordedObject:
    """The object of a recording.

    Attributes:
        size: along x, y and z of the world [m].
        up: the axis of the mesh file that points up; None: the built-in object, which has no file.
        scale: how the size was found, in words; None: the same.
    """

    size: tuple[float, float, float]
    up: str | None = None
    scale: str | None = None

    @staticmethod
    def find(folder: Path) -> "RecordedObject | None":
        """Return the object of a capture folder; None if its record names none."""
        record = RunRecord.find(folder)
        found = record.results.get("object") if record else None
        if not isinstance(found, dict):
            return None
        return RecordedObject(tuple(found["size"]), found.get("up"), found.get("scale"))
