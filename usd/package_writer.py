"""Writes the ZIP file of a ``.usdz`` package around its members: each is written once, in its place.

Members are stored uncompressed and begin at multiples of 64 bytes, as the specification of usdz demands; the
file has no 64-bit extension. All have the oldest time that a ZIP file can hold: with the true one, the same
scene would give different bytes every two seconds.
"""

import os
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from digs_warp.checks import UsdError
from digs_warp.usd.package import ALIGNMENT, END, ENTRY, LOCAL, MAX_PACKAGE

# 1 January 1980, 0:00.
_DATE, _TIME = (1 << 5) | 1, 0
_VERSION = 10  # of the ZIP format: stored members
_UTF8 = 1 << 11
# The padding before a member is an extra field of this kind, of at least its own header.
_PADDING_KIND = 0x1986
_MIN_PADDING = 4
# Bytes read at a time: they stay in the cache while they are looked at.
_PIECE = 1 << 20


@dataclass(frozen=True)
class _Entry:
    name: bytes
    header: int
    crc: int
    size: int


class PackageWriter:
    """A package in the making, at a path where nobody reads it yet; `close` makes it whole."""

    def __init__(self, path: Path, shown_path: Path) -> None:
        """Begin an empty package in the file ``path``, on the way to ``shown_path``."""
        self._path = path
        self._shown_path = shown_path
        self._entries: list[_Entry] = []
        self._end = 0
        path.write_bytes(b"")

    @contextmanager
    def member(self, name: str) -> Iterator[int]:
        """Give the place in the file where the next member begins; the block writes it from there to the end.

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
