"""Where the files are that a run noted: its paths are as they were given, often relative."""

from collections.abc import Iterator
from pathlib import Path


def places_of(noted: Path, folder: Path) -> Iterator[Path]:
    """Yield where a file may be that the run in a folder noted, the likeliest place first.

    A relative path is relative to the folder in which the command was started. That is mostly one above its
    results, and need not be the one of today.

    Args:
        noted: the path in the record.
        folder: the results.
    """
    if not noted.is_absolute():
        for above in (*folder.parents, *folder.absolute().parents):
            yield above / noted
    yield noted
