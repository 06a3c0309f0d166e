"""The binary format of USD (a crate, ``.usdc``): its frame and its table of values.

A header points to a table of sections at the end. The section FIELDS lists all values: small values directly,
others by their place in the file. An array of numbers is stored as its length (64 bits) and its bytes, as
they are in memory, so that readers can map it. The format is that of OpenUSD's
``pxr/usd/sdf/crateFile.cpp``; blocks are compressed with LZ4 (its block format).

The USD library writes a scene with one splat; `splice` replaces the arrays of that splat by those of all
splats, straight from where they are computed: it puts them behind the small arrays, points the table of
values to them, and moves the sections behind. The library itself would hold a million splats a second time,
hash them to find equal arrays, and copy them to the file. All this depends on how the library lays out a
file: `splice` refuses a crate that does not look as expected; then the library has to write the whole file.
"""

import os
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import Protocol

import numpy as np

CRATE_MAGIC = b"PXR-USDC"
HEADER = struct.Struct("<8s8Bq")
HEADER_SIZE = 88  # with the reserved words
SECTION = struct.Struct("<16sqq")
OLDEST_VERSION = (0, 4, 0)
COUNT = struct.Struct("<Q")
# Six kinds of sections exist; a count beyond this is not one of them.
_MAX_SECTIONS = 64


class Bytes(Protocol):
    """Bytes or a mapped file: anything with slices of bytes."""

    def __getitem__(self, rows: slice, /) -> bytes: ...


@dataclass(frozen=True)
class Section:
    """A part of a crate: its name, its offset from the start of the crate, and its length."""

    name: str
    start: int
    length: int


def read_sections(data: Bytes, what: str, start: int, size: int) -> list[Section]:
    """Return the sections of the crate in ``data[start : start + size]``.

    Raises:
        ValueError: header, table or sections are not inside the crate, or its version is older than
            0.4.0 (OpenUSD 17.11), which has other tables; names ``what``.
    """
    if size < HEADER_SIZE:
        raise ValueError(f"{what} has {size} bytes, fewer than the header of a crate")
    magic, *version, table = HEADER.unpack(data[start : start + HEADER.size])
    if magic != CRATE_MAGIC:
        raise ValueError(f"{what} does not begin as a crate")
    if tuple(version[:3]) < OLDEST_VERSION:
        found = ".".join(map(str, version[:3]))
        raise ValueError(
            f"{what} has version {found}, expected 0.4.0 or later; save it again with usdcat"
        )
    if not HEADER_SIZE <= table <= size - COUNT.size:
        raise ValueError(
            f"the table of {what} is at byte {table}, expected {HEADER_SIZE} to {size - COUNT.size}"
        )
    first = table + COUNT.size
    (count,) = COUNT.unpack(data[start + table : start + first])
    if count > _MAX_SECTIONS or first + count * SECTION.size > size:
        raise ValueError(f"the table of {what} claims {count} sections")
    entries = data[start + first : start + first + count * SECTION.size]
    sections = []
    for name, at, length in SECTION.iter_unpack(entries):
        label = name.rstrip(b"\0").decode("ascii", "replace")
        if at < HEADER_SIZE or length < 0 or at + length > size:
            raise ValueError(f"section '{label}' of {what} reaches beyond its end")
        sections.append(Section(label, at, length))
    return sections


def section_bodies(data: Bytes, start: int, sections: list[Section]) -> dict[str, bytes]:
    """Return the bytes of each section of the crate that begins at ``start``, by name."""
    return {
        each.name: data[start + each.start : start + each.start + each.length] for each in sections
    }


def read_count(data: bytes, at: int, what: str) -> int:
    """Return the 64 bits at a place of a table.

    Raises:
        ValueError: the table ends before; names ``what``.
    """
    if at + COUNT.size > len(data):
        raise ValueError(f"a table of {what} is cut off")
    return COUNT.unpack_from(data, at)[0]


def read_values(fields: bytes, what: str) -> tuple[bytes, np.ndarray]:
    """Return the section FIELDS up to the values, unchanged, and the values, uint64 (n,).

    Raises:
        ValueError: the section is cut off or broken; names ``what``.
    """
    number = read_count(fields, 0, what)
    end = 2 * COUNT.size + read_count(fields, COUNT.size, what)
    size = read_count(fields, end, what)
    begin = end + COUNT.size
    values = decompressed(fields[begin : begin + size], number * 8)
    if len(values) != number * 8:
        raise ValueError(
            f"the table of values of {what} holds {len(values)} bytes for {number} values"
        )
    return fields[:end], np.frombuffer(values, dtype="<u8").copy()


def decompressed(block: bytes, size: int) -> bytes:
    """Return at most ``size`` bytes of a compressed block: the number of its pieces, here 0, and LZ4.

    Raises:
        ValueError: the block is broken, or larger than ``size``.
    """
    if block[:1] != b"\0":
        raise ValueError("a compressed block of several pieces")
    out = bytearray()
    at = 1
    while at < len(block):
        token = block[at]
        length, at = _length(block, at + 1, token >> 4)
        if at + length > len(block):
            raise ValueError("a compressed block is cut off")
        out += block[at : at + length]
        at += length
        if at >= len(block):  # the last sequence has no copy
            break
        distance = int.from_bytes(block[at : at + 2], "little")
        length, at = _length(block, at + 2, token & 15)
        if not 0 < distance <= len(out) or len(out) + length + 4 > size:
            raise ValueError("a compressed block refers to what it does not hold")
        _repeat(out, distance, length + 4)
    if len(out) > size:
        raise ValueError(f"a compressed block holds {len(out)} bytes, expected up to {size}")
    return bytes(out)


def _length(block: bytes, at: int, length: int) -> tuple[int, int]:
    """Return a length that starts with four bits (15: more bytes follow), and where the block continues."""
    if length == 15:
        while True:
            if at >= len(block):
                raise ValueError("a compressed block is cut off")
            length += block[at]
            at += 1
            if block[at - 1] != 255:
                break
    return length, at


def _repeat(out: bytearray, distance: int, length: int) -> None:
    """Append ``length`` bytes from ``distance`` before the end, repeated if there are fewer."""
    piece = bytes(out[-distance:])
    out += (piece * (length // distance + 1))[:length]


def stored(data: bytes) -> bytes:
    """Return ``data`` as a block that `decompressed` and USD read: one run of literal bytes."""
    extra = len(data) - 15
    if extra < 0:
        return bytes([0, len(data) << 4]) + data
    return bytes([0, 0xF0]) + b"\xff" * (extra // 255) + bytes([extra % 255]) + data


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
