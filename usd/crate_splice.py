"""Puts large arrays into a small crate, straight from where they are computed.

The USD library writes the scene with one splat. Here its arrays are exchanged for those of all splats: they
are written behind what is there, the table of values points to them, and the sections follow. So a million
splats need not pass through the library, which holds them all, hashes them to find equal ones, and copies
them to the file: that takes longer, and their memory a second time.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from digs_warp.usd.crate import COUNT, HEADER, SECTION, Section, decompressed, read_sections, stored

# Arrays begin at multiples of this: mapped, they can be used in place.
_ALIGNMENT = 64

# A value is 64 bits: is it an array, does it lie here itself, is it compressed, its type, and its place.
_IS_ARRAY, _IS_INLINED, _IS_COMPRESSED = (np.uint64(1 << bit) for bit in (63, 62, 61))
_PLACE = np.uint64((1 << 48) - 1)


@dataclass(frozen=True, eq=False)
class SplicedCrate:
    """A crate whose large arrays are still to be written; places count from its start.

    Attributes:
        head: the bytes before the arrays, whose small arrays may still be changed.
        starts: name -> where the bytes of its array belong.
        lengths: where the length of each array belongs -> the length.
        tail: the bytes behind the arrays.
        tail_start: where they belong.
    """

    head: bytearray
    starts: dict[str, int]
    lengths: dict[int, int]
    tail: bytes
    tail_start: int

    def replace_small(self, before: np.ndarray, after: np.ndarray) -> None:
        """Exchange an array of the head for one of the same size."""
        place = _place_in(self.head, before)
        assert before.nbytes == after.nbytes
        self.head[place + COUNT.size : place + COUNT.size + after.nbytes] = after.tobytes()

    def write_frame(self, file: int, start: int) -> None:
        """Write all but the arrays to a file, by its descriptor, from ``start`` on."""
        write_at(file, self.head, start)
        for place, length in self.lengths.items():
            write_at(file, COUNT.pack(length), start + place)
        write_at(file, self.tail, start + self.tail_start)


def splice(crate: bytes, placeholders: Mapping[str, np.ndarray], count: int) -> SplicedCrate:
    """Make room in a crate for ``count`` times as many rows of each of its ``placeholders``.

    Args:
        crate: a file of the USD library.
        placeholders: name -> an array in it, of rows (n, ...); no two hold the same.
        count: the factor, at least 1.

    Raises:
        ValueError: the crate does not hold a placeholder as expected.
    """
    sections = read_sections(crate, "the scene", 0, len(crate))
    first = min(section.start for section in sections)
    head = bytearray(crate[:first])
    bodies = {each.name: crate[each.start : each.start + each.length] for each in sections}
    indices, places = _read_values(bodies["FIELDS"])
    starts, lengths = {}, {}
    at = first
    for name, array in placeholders.items():
        old = _place_in(head, array)
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
    magic, *version, _ = HEADER.unpack_from(head)
    HEADER.pack_into(head, 0, magic, *version, table)
    return SplicedCrate(head, starts, lengths, tail, at)


def _place_in(head: bytes | bytearray, array: np.ndarray) -> int:
    """Return where the only copy of an array lies: its length, then its bytes."""
    content = COUNT.pack(len(array)) + array.tobytes()
    place = head.find(content)
    if place < 0 or head.find(content, place + 1) >= 0:
        raise ValueError("the scene does not hold an array exactly once")
    return place


def _read_values(fields: bytes) -> tuple[bytes, np.ndarray]:
    """Return the section FIELDS up to the values, unchanged, and the values, uint64 (n,)."""
    (number,) = COUNT.unpack_from(fields, 0)
    (names_size,) = COUNT.unpack_from(fields, COUNT.size)
    end = 2 * COUNT.size + names_size
    (size,) = COUNT.unpack_from(fields, end)
    begin = end + COUNT.size
    values = decompressed(fields[begin : begin + size], number * 8)
    return fields[:end], np.frombuffer(values, dtype="<u8").copy()


def _with_table(sections: list[Section], bodies: dict[str, bytes], at: int) -> tuple[bytes, int]:
    """Return all sections, laid from ``at`` on, with their table behind them, and where the table lies."""
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
