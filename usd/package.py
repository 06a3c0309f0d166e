"""The ZIP structure of a ``.usdz`` package: read without USD, before USD maps the file.

A package stores its members uncompressed, aligned to 64 bytes, without the 64-bit extension; the first one
is the scene, all of them lie inside by relative names.
"""

import mmap
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path, PurePosixPath, PureWindowsPath

from digs_warp.usd.findings import Finding

ALIGNMENT = 64
END = struct.Struct("<4s4H2LH")
ENTRY = struct.Struct("<4s6H3L5H2L")
LOCAL = struct.Struct("<4s5H3L2H")
# The comment behind the end of the directory has a length of 16 bits.
_END_REACH = END.size + 0xFFFF
# Offsets have 32 bits; some of that is for the headers and the alignment of members.
MAX_PACKAGE = 2**32 - 2**16
LAYER_SUFFIXES = (".usda", ".usdc", ".usd")


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
    """Whether a member's name is absolute, or goes up, on any system."""
    return (
        not name
        or PurePosixPath(name).is_absolute()
        or PureWindowsPath(name).drive != ""
        or PureWindowsPath(name).is_absolute()
        or ".." in PurePosixPath(name.replace("\\", "/")).parts
    )


def read_members(data: mmap.mmap) -> list[Member]:
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
            raise ValueError(f"members '{before.name}' and '{after.name}' overlap")
    return members


def _read_entry(data: mmap.mmap, at: int, end: int) -> tuple[Member, int]:
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
        raise ValueError(f"member '{name}' reaches beyond the file")
    header = LOCAL.unpack_from(data, local)
    if header[0] != b"PK\3\4":
        raise ValueError(f"the header of member '{name}' is broken")
    if (header[6], header[7], header[8]) != (fields[7], stored, size):
        raise ValueError(f"member '{name}' has two different sizes or checksums")
    start = local + LOCAL.size + header[9] + header[10]
    if start + stored > end:
        raise ValueError(f"member '{name}' reaches beyond the file")
    member = Member(name, start, size, method != 0 or stored != size, bool(flags & 1))
    return member, at + ENTRY.size + name_length + extra_length + comment_length
