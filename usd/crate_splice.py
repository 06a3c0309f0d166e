"""Puts large arrays into a small crate, straight from where they are computed.

The USD library writes the scene with one splat. `splice` then replaces the arrays of that splat by those of
all splats: it puts them behind the small arrays, points the table of values to them, and moves the sections
behind them. The library itself would hold a million splats a second time, hash them to find equal arrays,
and copy them to the file.

All this depends on how the library lays out a file. `splice` refuses a crate that does not look as expected;
then the library has to write the whole file.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from digs_warp.usd.crate import (
    COUNT,
    HEADER,
    SECTION,
    Section,
    read_sections,
    read_values,
    section_bodies,
    stored,
)

# Arrays begin at multiples of this: mapped, they can be used in place.
_ALIGNMENT = 64

# The layout is the same in all of these: lengths of arrays have 64 bits since 0.7.0, and 0.16.0 is the newest
# version of OpenUSD 26.11. A later one may have moved anything.
_KNOWN_VERSIONS = ((0, 7, 0), (0, 16, 0))

# A value has 64 bits: three flags (an array; stored here, not at a place; compressed), its type, its place.
_IS_ARRAY, _IS_INLINED, _IS_COMPRESSED = (np.uint64(1 << bit) for bit in (63, 62, 61))
_PLACE = np.uint64((1 << 48) - 1)


@dataclass(frozen=True, eq=False)
class SplicedCrate:
    """A crate whose large arrays are still to be written; places count from its start.

    Attributes:
        head: the bytes before the large arrays.
        summaries: name -> where the bytes of a small array are in ``head``.
        starts: name -> where the bytes of a large array belong.
        lengths: where the length of each large array belongs -> the length.
        tail: the bytes behind the large arrays.
        tail_start: where they belong.
    """

    head: bytearray
    summaries: dict[str, int]
    starts: dict[str, int]
    lengths: dict[int, int]
    tail: bytes
    tail_start: int

    def set_summary(self, name: str, values: np.ndarray) -> None:
        """Replace a small array by one of the same size and type."""
        place = self.summaries[name]
        self.head[place : place + values.nbytes] = values.tobytes()

    def write_frame(self, file: int, start: int) -> None:
        """Write all but the arrays to a file, by its descriptor, from ``start`` on."""
        write_at(file, self.head, start)
        for place, length in self.lengths.items():
            write_at(file, COUNT.pack(length), start + place)
        write_at(file, self.tail, start + self.tail_start)


def splice(
    crate: bytes,
    placeholders: Mapping[str, np.ndarray],
    summaries: Mapping[str, np.ndarray],
    count: int,
) -> SplicedCrate:
    """Make room in a crate for ``count`` times as many rows of each of its ``placeholders``.

    Args:
        crate: a file that the USD library wrote.
        placeholders: name -> an array in it, of rows (n, ...); no two are equal.
        summaries: name -> a small array in it that `SplicedCrate.set_summary` is going to replace.
        count: the factor, at least 1.

    Raises:
        ValueError: the crate has a version or a layout that is not known here.
    """
    sections = read_sections(crate, "the scene", 0, len(crate))
    magic, *version, _ = HEADER.unpack_from(crate)
    oldest, newest = _KNOWN_VERSIONS
    if not oldest <= tuple(version[:3]) <= newest:
        raise ValueError(f"version {'.'.join(map(str, version[:3]))} of the format")
    first = min(section.start for section in sections)
    head = bytearray(crate[:first])
    bodies = section_bodies(crate, 0, sections)
    indices, places = read_values(bodies.get("FIELDS", b""), "the scene")
    starts, lengths = {}, {}
    at = first
    for name, array in placeholders.items():
        old = _place_in(head, array) - COUNT.size
        kind = _IS_ARRAY | _IS_INLINED | _IS_COMPRESSED
        mine = (places & _PLACE == old) & (places & kind == _IS_ARRAY)
        if not mine.any():
            raise ValueError(f"no value of the scene is the array of {name}")
        start = -(-(at + COUNT.size) // _ALIGNMENT) * _ALIGNMENT
        starts[name], lengths[start - COUNT.size] = start, len(array) * count
        places[mine] = (places[mine] & ~_PLACE) | np.uint64(start - COUNT.size)
        at = start + array.nbytes * count
    block = stored(places.tobytes())
    bodies["FIELDS"] = indices + COUNT.pack(len(block)) + block
    tail, table = _with_table(sections, bodies, at)
    HEADER.pack_into(head, 0, magic, *version, table)
    small = {name: _place_in(head, array) for name, array in summaries.items()}
    return SplicedCrate(head, small, starts, lengths, tail, at)


def _place_in(head: bytes | bytearray, array: np.ndarray) -> int:
    """Return where the bytes of an array are, behind their number; they must be there only once."""
    content = COUNT.pack(len(array)) + array.tobytes()
    place = head.find(content)
    if place < 0 or head.find(content, place + 1) >= 0:
        raise ValueError("the scene does not hold an array exactly once")
    return place + COUNT.size


def _with_table(sections: list[Section], bodies: dict[str, bytes], at: int) -> tuple[bytes, int]:
    """Return all sections, to be stored at ``at``, with their table behind them, and where the table is."""
    parts = [bodies[section.name] for section in sections]
    starts = list(accumulate((len(part) for part in parts), initial=at))
    entries = [
        SECTION.pack(section.name.encode(), start, len(part))
        for section, start, part in zip(sections, starts[:-1], parts, strict=True)
    ]
    return b"".join([*parts, COUNT.pack(len(entries)), *entries]), starts[-1]


def write_at(file: int, data: bytes | bytearray | memoryview, place: int) -> None:
    """Write all bytes at a place of a file; the system may take them in several pieces."""
    view = memoryview(data).cast("B")
    while len(view):
        written = os.pwrite(file, view, place)
        view, place = view[written:], place + written
