"""What each component is worth: those of the start, and what the training knows of the camera."""

from collections.abc import Sequence

from digs_warp.study.engine.case import Case
from digs_warp.study.engine.records import Record
from digs_warp.study.page import Section
from digs_warp.study.scenes import Objects
from studies.components import camera, start

# The start has many variants: the first objects have to do.
START_OBJECTS = 2


def cases(objects: Objects, seeds: int = 1, iterations: int = 300) -> list[Case]:
    """Return the cases of the start, then those of the camera."""
    first = dict(list(objects.items())[:START_OBJECTS])
    return [*start.cases(first, seeds, iterations), *camera.cases(objects, seeds, iterations)]


def sections(records: Sequence[Record]) -> list[Section]:
    """Return the findings of both parts, as far as they were measured."""
    parts = {"variant": start.sections, "training": camera.sections}
    found = []
    for label, of_part in parts.items():
        mine = [record for record in records if label in record["labels"]]
        found += of_part(mine) if mine else []
    return found
