"""The ZIP structure of a ``.usdz`` package: checked before USD maps the file, written around its members.

A package stores its members uncompressed, aligned to 64 bytes, without the 64-bit extension. The first one is
the scene; all have relative names. What we write has the oldest time that a ZIP file can hold: with the true
time, the same scene would give different bytes every two seconds.
"""

import mmap
import os
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path, PurePosixPath, PureWindowsPath

from digs_warp.checks import UsdError
from digs_warp.usd.findings import Finding
from digs_warp.words import quoted

ALIGNMENT = 64
END = struct.Struct("<4s4H2LH")
ENTRY = struct.Struct("<4s6H3L5H2L")
LOCAL = struct.Struct("<4s5H3L2H")
# The comment behind the end of the directory has a length of 16 bits.
_END_REACH = END.size + 0xFFFF
# Offsets have 32 bits; some of that is for the headers and the alignment of members.
MAX_PACKAGE = 2**32 - 2**16
LAYER_SUFFIXES = (".usda", ".usdc", ".usd")

# 1 January 1980, 0:00.
_DATE, _TIME = (1 << 5) | 1, 0
_VERSION = 10  # of the ZIP format: stored members
_UTF8 = 1 << 11
# The padding before a member is an extra field of this kind, of at least its own header.
_PADDING_KIND = 0x1986
_MIN_PADDING = 4
# Bytes read at a time: they stay in the cache.
_PIECE = 1 << 20


@dataclass(frozen=True)
class Member:
    """One file in a package: its name, where its bytes are, and how they are stored."""

    name: str
    start: int
    size: int
    compressed: bool
    encrypted: bool


@contextmanager
def mapped(path: Path) -> Iterator[mmap.mmap]:
    """Map a file that is not empty for reading: packages and crates are large, their frames small.

    Raises:
        ValueError: the file is empty.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        yield data


def check_package(path: Path) -> Iterator[Finding]:
    """Yield what is wrong with the structure of a ``.usdz`` file; nothing for other files."""
    if path.suffix.lower() != ".usdz" or not path.is_file():
        return
    try:
        with mapped(path) as data:
            members = read_members(data)
    except ValueError as error:
        yield Finding("package-structure", "error", str(error))
        return
    if not members:
        yield Finding("package-structure", "error", "the package is empty")
        return
    for member in members:
        yield from _check_member(member)
    names = [member.name for member in members]
    if len(set(names)) < len(names):
        yield Finding("package-names", "error", "two members have the same name")
    first = PurePosixPath(names[0])
    if first.suffix.lower() not in LAYER_SUFFIXES:
        message = f"the first member is '{first}', expected the scene"
        yield Finding("package-root", "error", message)
    elif str(first.stem) != "default":
        message = f"the first member is '{first}'; some importers look for 'default.usdc'"
        yield Finding("package-root", "warning", message)


def _check_member(member: Member) -> Iterator[Finding]:
    if member.compressed or member.encrypted:
        how = "compressed" if member.compressed else "encrypted"
        yield Finding(
            "package-storage", "error", "expected a stored member, found " + how, member.name
        )
    if member.start % ALIGNMENT:
        message = f"its bytes start at {member.start}, expected a multiple of {ALIGNMENT}"
        yield Finding("package-alignment", "error", message, member.name)
    if leaves_package(member.name):
        message = "absolute and parent paths lead out of the package"
        yield Finding("package-names", "error", message, member.name)


def leaves_package(name: str) -> bool:
    """Whether a member's name is absolute or leads to a parent folder, on any system."""
    return (
        not name
        or PurePosixPath(name).is_absolute()
        or PureWindowsPath(name).drive != ""
        or PureWindowsPath(name).is_absolute()
        or ".." in PurePosixPath(name.replace("\\", "/")).parts
    )


def read_members(data: mmap.mmap | bytes) -> list[Member]:
    """Return the members of a ZIP file, in the order of its directory.

    Raises:
        ValueError: not a ZIP file, truncated, with members that overlap or reach beyond the file, or with
            the 64-bit extension.
    """
    end = data.rfind(b"PK\5\6", max(0, len(data) - _END_REACH))
    if end < 0 or end + END.size > len(data):
        raise ValueError(
            "no directory of a ZIP file at its end; the file is truncated or no package"
        )
    _, _, _, _, count, size, offset, _ = END.unpack_from(data, end)
    if 0xFFFFFFFF in (size, offset) or count == 0xFFFF:
        raise ValueError("a package has no 64-bit extension")
    if offset + size > end:
        raise ValueError("the directory reaches beyond the file")
    members = []
    at = offset
    for _ in range(count):
        member, at = _read_entry(data, at, end)
        members.append(member)
    in_order = sorted(members, key=lambda member: member.start)
    for before, after in pairwise(in_order):
        if before.start + before.size > after.start:
            raise ValueError(f"members {quoted(before.name)} and {quoted(after.name)} overlap")
    return members


def _read_entry(data: mmap.mmap | bytes, at: int, end: int) -> tuple[Member, int]:
    if at + ENTRY.size > end:
        raise ValueError("the directory is cut off")
    fields = ENTRY.unpack_from(data, at)
    signature, flags, method, stored, size = fields[0], fields[3], fields[4], fields[8], fields[9]
    name_length, extra_length, comment_length, local = (
        fields[10],
        fields[11],
        fields[12],
        fields[16],
    )
    if signature != b"PK\1\2":
        raise ValueError("an entry of the directory is broken")
    name = data[at + ENTRY.size : at + ENTRY.size + name_length].decode("utf-8", "replace")
    if local + LOCAL.size > end:
        raise ValueError(f"member {quoted(name)} reaches beyond the file")
    header = LOCAL.unpack_from(data, local)
    if header[0] != b"PK\3\4":
        raise ValueError(f"the header of member {quoted(name)} is broken")
    if (header[6], header[7], header[8]) != (fields[7], stored, size):
        raise ValueError(f"member {quoted(name)} has two different sizes or checksums")
    start = local + LOCAL.size + header[9] + header[10]
    if start + stored > end:
        raise ValueError(f"member {quoted(name)} reaches beyond the file")
    member = Member(name, start, size, method != 0 or stored != size, bool(flags & 1))
    return member, at + ENTRY.size + name_length + extra_length + comment_length


@dataclass(frozen=True)
class _Entry:
    name: bytes
    header: int
    crc: int
    size: int


class PackageWriter:
    """A package that is being written, at a path where nobody reads it yet; `close` finishes it."""

    def __init__(self, path: Path, shown_path: Path) -> None:
        """Begin an empty package in the file ``path``, on the way to ``shown_path``."""
        self._path = path
        self._shown_path = shown_path
        self._entries: list[_Entry] = []
        self._end = 0
        path.write_bytes(b"")

    @contextmanager
    def member(self, name: str) -> Iterator[int]:
        """Give the place in the file where the next member begins; the block writes it there.

        Raises:
            UsdError: the package becomes too large.
        """
        label = name.encode()
        header = self._end
        padding = -(header + LOCAL.size + len(label)) % ALIGNMENT
        padding += ALIGNMENT if 0 < padding < _MIN_PADDING else 0
        start = header + LOCAL.size + len(label) + padding
        yield start
        with self._path.open("r+b") as file:
            size = file.seek(0, os.SEEK_END) - start
            check_package_size(start + size, self._shown_path)
            file.seek(start)
            entry = _Entry(label, header, _checksum(file), size)
            file.seek(header)
            file.write(_local_header(entry, padding) + label + _filler(padding))
        self._entries.append(entry)
        self._end = start + size

    def add(self, source: Path, name: str) -> None:
        """Copy a file into the package."""
        with (
            self.member(name) as start,
            source.open("rb") as file,
            self._path.open("r+b") as target,
        ):
            target.seek(start)
            while piece := file.read(_PIECE):
                target.write(piece)

    def close(self) -> None:
        """Write the directory."""
        directory = b"".join(_directory_entry(entry) for entry in self._entries)
        count = len(self._entries)
        end = END.pack(b"PK\5\6", 0, 0, count, count, len(directory), self._end, 0)
        with self._path.open("r+b") as file:
            file.seek(self._end)
            file.write(directory + end)


def check_package_size(size: int, path: Path) -> None:
    """Raise a `UsdError` when ``size`` bytes do not fit into a usdz package."""
    if size > MAX_PACKAGE:
        raise UsdError(
            f"USD scene '{path}': {size} bytes do not fit into a usdz package (below 4 GiB); store fewer "
            "splats, half precision or a lower degree, or write a .usdc file"
        )


def _checksum(file) -> int:
    crc = 0
    while piece := file.read(_PIECE):
        crc = zlib.crc32(piece, crc)
    return crc


def _local_header(entry: _Entry, padding: int) -> bytes:
    sizes = (entry.crc, entry.size, entry.size, len(entry.name), padding)
    return LOCAL.pack(b"PK\3\4", _VERSION, _UTF8, 0, _TIME, _DATE, *sizes)


def _filler(padding: int) -> bytes:
    if padding == 0:
        return b""
    length = padding - _MIN_PADDING
    return _PADDING_KIND.to_bytes(2, "little") + length.to_bytes(2, "little") + bytes(length)


def _directory_entry(entry: _Entry) -> bytes:
    sizes = (entry.crc, entry.size, entry.size, len(entry.name), 0, 0)
    places = (0, 0, 0, entry.header)
    return (
        ENTRY.pack(b"PK\1\2", _VERSION, _VERSION, _UTF8, 0, _TIME, _DATE, *sizes, *places)
        + entry.name
    )
