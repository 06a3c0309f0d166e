"""The binary format of USD (a crate, ``.usdc``): its frame and its table of values.

A header points to a table of sections at the end. The section FIELDS lists all values: small values directly,
others by their place in the file. An array of numbers is stored as its length (64 bits) and its bytes, as
they are in memory, so that readers can map it. The format is that of OpenUSD's
``pxr/usd/sdf/crateFile.cpp``; blocks are compressed with LZ4 (its block format).
"""

import struct
from dataclasses import dataclass
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
